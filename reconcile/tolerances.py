"""The tolerances of reconcile's core: each with its meaning, its unit and the reason for its value.

Everything else follows from the recordings: rates, windows and delays scale with them.
"""

STUDENT = 6.0  # degrees of freedom of the innovations' distribution: outliers of real recordings count little
OUTPUT_FLOOR = (
    2e-3  # of an output's spread: its least noise; below it the likelihood lives on what no model has
)
OF_ERROR = 0.1  # the same, of the error ahead where that is less: errors of one step go with those of many
LEAST_FLOOR = 2e-5  # the same, whatever the error: steps of the numbers in a recording are as large
MOST_SAMPLES = (
    8000  # steps of all runs together that are filtered: more are thinned, since cost goes with them
)
PRIOR = 2.3  # nats that an effect costs: as if ten different ones were as likely, since many look alike
SEPARABLE = (
    1e-4  # of an effect's own information that must be left beside what is fitted, else it is unidentifiable
)
PLAIN = 0.5  # nats that a parameter costs beside what the data say of it: the simpler of two that are alike
MOST_STEPS = 1e8  # steps of the filter after which a search ends with the sets it has: about two core minutes
WORTH = 2.0  # nats: a larger set that gains less is not looked for any further
SINGLES, KEPT = (6, 4, 3), (3, 2, 1)  # effects tried at each of the best sets of a level, and sets kept of it
CLOSE = 12.0  # nats below the best evidence within which a set counts for the probabilities
RESAMPLED = 400  # draws of the training blocks: probabilities then move by some per cent from draw to draw
BLOCKS = 30  # of all training data, for that
SURE = 0.9  # probability from which an effect, or a kind, is named
CERTAIN = (
    0.99  # probability from which data that hardly show an effect need not say more than that it is there
)
SHORTENED, OF_ALL = (
    0.05,
    0.01,
)  # of the multi-step error left, and of the whole gap, that a named effect takes away
NEAR, TOLD = (
    0.02,
    5.0,
)  # error ahead below which a model is near enough for small effects; nats that they then gain
OF_NATS = 0.02  # of the nats that all effects gain there: what gains less is a crumb
ALONE = 0.8  # probability of what the output error alone tells: no evidence gives it, and it is not SURE
EXPLAINED = 0.5  # of the error ahead that an answer must take away where more than noise is left
AT_FLOOR = 3.0  # times the noise: an error ahead below it is nothing unexplained
STEP = 1e-4  # of a parameter's size: for slopes by differences, above rounding and below curvature
SEEN = 4.0  # noise levels that an output must move by
KNOWN = 0.5  # of its prior's deviation: a parameter known no better than that was not excited
MOVED = 3.0  # standard errors by which a re-estimated parameter must have moved
# nats by which the outputs must be likelier without an input's noise, with noise that has a memory, with an
# offset in time: that these are there is as unlikely beforehand as a few effects at once
INPUT_GAIN = 10.0
CLOCK_GAIN = 10.0  # nats a recording by which clocks of their own must be likelier than one offset for all
WRONG = 0.1  # error ahead, in spreads, from which signs and units of channels are asked
LOST = 0.5  # the same, beyond which a model explains nothing, or its inputs are far too large or small
HALVED = 0.5  # of that error, left at most where recordings are read otherwise: then that is asked

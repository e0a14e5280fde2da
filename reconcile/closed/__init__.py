"""A third-party FMU as the model: a closed box, to which effects attach at its ports only.

box       the FMU: its inputs, outputs and parameters, and simulation of it
port      effects in front of its inputs, behind its outputs or on a disturbance input, as a model
candidates  which effects of the catalogue fit which port
simulation  what box and ports answer to a recording
problem   simulation error over whole recordings, and its least-squares fit
starts    what initial states do that its inputs reach: no error
fitted    a fit and what it is worth
search    one effect after the other, accepted by the rules of evidence.py; rivals
where     where it and the recordings disagree
unidentifiable  what they cannot tell
report    the figures in the form of the contract
wrap      an SSP of the FMU with the effects at its ports
"""

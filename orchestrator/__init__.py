"""The co-simulation master: a system description in, a run record out.

archive, xmlfile     files that others made, read with care (paths: and found only inside their package)
sspforms, ssptext    every name of SSP and what becomes of it; a file held to them
ssd, ssv, ssm, ssb   the description as plain data (description, ssc, bindings), each part with its place;
                     annotation: what it asks of the run
flatten, ends        nested systems as one net of FMUs and signals (net)
parameters, values   start values by hierarchical name and precedence
signals, sizes       types, units and sizes along a connection, folded into one conversion
modeldescription     what an FMU says of itself
components, wiring   the FMUs and connections checked against each other (clocks: and against the step)
check                `load_system`: all of it, giving a System (system)
order, layout        the System as flat cells, and in which order they are filled
interventions        faults and parameter changes of a run, checked
core/                the compiled core: FMUs loaded, stepped, recorded
native, binding      the core's library, and its functions through ctypes (wire: numbers both sides use)
instance             one FMU on its own
lowering, master     the plan of a core, and a core that runs it
simulate             `simulate`: stimuli, steps, record
pack                 a system of `specs/systems` and its FMUs as one file
"""

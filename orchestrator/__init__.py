"""The co-simulation master: a system description in, a run record out.

archive, xmlfile     files that others made, read with care
ssd, ssv             the description as plain data (description), each part with its line
modeldescription     what an FMU says of itself
components, wiring   the FMUs and connections checked against each other
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

"""The co-simulation master: a system description in, a run record out.

archive, xmlfile     files that others made, read with care
ssd, ssv             the description as plain data (description), each part with its line
modeldescription     what an FMU says of itself
components, wiring   the FMUs and connections checked against each other
check                `load_system`: all of it, giving a System (system)
layout               the System as flat arrays and indices
fmu, fmi2, fmi3      the C interface through ctypes
master               one step of all FMUs, Jacobi or Gauss-Seidel
simulate             `simulate`: stimuli, steps, record
pack                 a system of `specs/systems` and its FMUs as one file
"""

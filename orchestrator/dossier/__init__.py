"""The validation dossier of the simulated reference machine: `run` computes every figure and writes the page.

section      what a chapter is made of; Markdown tables         svg      charts
calibration  traces, scores                                     machine  the machine's FMU on a bench
parameters   what the traces identify                           steps    the machine against the step traces
residuals    where the slew model errs                          physics, halving    power, rest, tool, integrator
trust        where the traces err                               draws    spreads of the re-drawn machines
"""

from orchestrator.dossier.page import FULL, Effort, run

__all__ = ["FULL", "Effort", "run"]

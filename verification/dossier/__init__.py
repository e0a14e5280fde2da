"""The validation dossier of the simulated reference machine: `run` computes every figure and writes the page.

page         the chapters put together          section, markdown, svg   what they are made of
calibration  traces, fit, scores                chapters/                their words, with placeholders
parameters   what the traces identify           machine                  the machine's FMU on a bench
residuals    where the slew model errs          steps                    the machine against the step traces
trust        where the traces err               physics, halving         power, rest, tool, integrator
draws        spreads of the re-drawn machines
"""

from verification.dossier.page import FULL, Effort, run

__all__ = ["FULL", "Effort", "run"]

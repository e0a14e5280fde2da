"""Faults of other people's FMUs: damaged, of another computer, or failing while they run."""

from deployment.faults.table import Fault

FILE_MS = 5000.0  # of a user who waits for an answer about a file
LIMIT_S = 2.0  # that one call of an FMU may take in these runs
ENDED_MS = 5000.0  # of a run whose FMU has ended
SILENT_MS = 1000.0 * LIMIT_S + 5000.0
REFUSED = "refused by name, nothing of it is run"
ENDS = "the run ends and names it; what was recorded is kept"


def refused(name: str, what: str) -> Fault:
    """A file that must be refused before anything of it is run."""
    return Fault(name, what, REFUSED, FILE_MS, "fmu")


FMU = (
    refused("fmu_archive_cut", "an FMU's archive ends too early"),
    refused("fmu_description_cut", "an FMU's description ends too early"),
    refused("fmu_description_missing", "an FMU without its description"),
    refused("fmu_library_missing", "an FMU without a library for this computer"),
    refused("fmu_library_empty", "an FMU's library is an empty file"),
    refused("fmu_library_cut", "an FMU's library ends too early"),
    refused("fmu_library_pointer", "a pointer of Git LFS, or another text, in place of an FMU's library"),
    refused("fmu_library_other_system", "an FMU's library is of another operating system"),
    refused("fmu_library_other_processor", "an FMU's library is for another processor"),
    refused("fmu_function_missing", "an FMU's library lacks a function that a run needs"),
    refused("fmu_version_other", "an FMU says that it is of an FMI version that there is not"),
    Fault("fmu_killed", "the process of an FMU is killed in a run", ENDS, ENDED_MS, "fmu"),
    Fault("fmu_silent", "an FMU gives no answer in a run", ENDS, SILENT_MS, "fmu"),
)

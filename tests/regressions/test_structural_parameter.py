"""A parameter that sizes arrays, and a value of it that no memory holds."""

from dataclasses import replace

from tests.orchestrator.fuzz.judge import judge
from tests.orchestrator.fuzz.seeds import seeds


def test_a_structural_parameter_cannot_ask_for_all_memory() -> None:
    """A size that the FMU allows and no machine has."""
    rich = next(case for case in seeds() if "values.ssv" in case.files)
    size = 2**40
    fmus = {
        path: {name: text.replace(' min="0" max="5"', "") for name, text in parts.items()}
        for path, parts in rich.fmus.items()
    }
    values = rich.files["values.ssv"].replace('<ssv:UInt64 value="2"/>', f'<ssv:UInt64 value="{size}"/>')
    ssd = rich.files["SystemStructure.ssd"].replace(
        '<ssc:Dimension size="2"/></ssd:Connector>', "</ssd:Connector>"
    )
    case = replace(rich, fmus=fmus, files={**rich.files, "values.ssv": values, "SystemStructure.ssd": ssd})
    verdict = judge(case)
    assert not verdict.accepted
    assert f"component first: its arrays have {3 * size + 4} elements" in verdict.message

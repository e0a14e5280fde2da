"""Steps, statuses, messages, events and states through the binding, on FMUs that misbehave when told to.

With the FMU in this process, and in one of its own.
"""

import ctypes
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from orchestrator.core.fmu_binding import FUNCTIONS, MESSAGES, TYPES, EventResult, StepResult
from orchestrator.fmi.instance import Instance
from specs.errors import InputError, RunError
from tests.orchestrator import every as tricks
from tests.orchestrator.every import Every, every
from tests.orchestrator.fmi.test_fmu_values import started

H = 0.1


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI2", "FMI3"])
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Every:
    return every(request.param, tmp_path_factory.mktemp("every"))


@pytest.fixture(scope="module")
def built3(tmp_path_factory: pytest.TempPathFactory) -> Every:
    return every(3, tmp_path_factory.mktemp("every"))


@pytest.fixture(scope="module", params=[False, True], ids=["here", "apart"])
def apart(request: pytest.FixtureRequest) -> bool:
    return request.param


@pytest.fixture
def instance(built: Every, apart: bool) -> Iterator[Instance]:
    with started(built, apart) as made:
        yield made


def counter(built: Every, name: str) -> int:
    """A global number of the FMU's library."""
    return ctypes.c_int.in_dll(ctypes.CDLL(str(built.component.library)), name).value


def entry(instance: Instance, name: str) -> Any:
    """A function of the core's table, which the instance's first member points to."""
    table = ctypes.cast(instance.pointer, ctypes.POINTER(ctypes.c_void_p))[0]
    address = ctypes.cast(table, ctypes.POINTER(ctypes.c_void_p))[list(FUNCTIONS).index(name)]
    return TYPES[name](address)


def raw_step(instance: Instance, time: float = 1.0) -> tuple[int, StepResult]:
    """Status and result of a step, whatever it is."""
    result = StepResult()
    return entry(instance, "step")(instance.pointer, time, H, ctypes.byref(result)), result


# ---- steps ----


def test_a_step_reaches_its_end(instance: Instance) -> None:
    result = instance.step(1.0, H)
    assert result.reached == 1.0 + H
    assert (result.event, result.terminate, result.early) == (False, False, False)


def test_a_warning_passes(instance: Instance) -> None:
    instance.set(trick=tricks.WARNING)
    assert raw_step(instance)[0] == 1
    assert instance.step(1.0, H).reached == 1.0 + H
    assert instance.last_words().startswith("as you wish")


def test_a_discarded_step_says_how_far_it_got(instance: Instance) -> None:
    instance.set(trick=tricks.DISCARD)
    status, result = raw_step(instance)
    assert (status, result.reached, result.terminate) == (2, 1.0 + H / 4, False)
    with pytest.raises(RunError, match=r"component every: step returned discard \(as you wish"):
        instance.step(1.0, H)


def test_an_fmu_may_end_the_simulation(instance: Instance) -> None:
    """FMI 2 says so by discarding the step and answering when asked; FMI 3 in the step itself."""
    instance.set(trick=tricks.END)
    status, result = raw_step(instance)
    assert result.terminate
    assert status == (2 if instance.model.fmi_version == 2 else 0)


def test_a_step_may_return_early(built3: Every, apart: bool) -> None:
    with started(built3, apart) as instance:
        instance.set(trick=tricks.EARLY)
        result = instance.step(1.0, H)
        assert (result.early, result.reached) == (True, 1.0 + H / 2)


def test_an_fmu_that_may_not_return_early_is_told(tmp_path: Path) -> None:
    built = every(3, tmp_path, modes=False)
    with started(built) as instance:
        instance.set(trick=tricks.EARLY)
        assert not instance.step(1.0, H).early


@pytest.mark.parametrize(
    ("trick", "word"), [(tricks.ERROR, "error"), (tricks.UNKNOWN, "error"), (tricks.FATAL, "fatal")]
)
def test_a_failing_step_is_an_error(instance: Instance, trick: int, word: str) -> None:
    instance.set(trick=trick)
    why = "DoStep returned the unknown status 17" if trick == tricks.UNKNOWN else "as you wish"
    with pytest.raises(RunError, match=rf"component every: step returned {word} \(.*{why}"):
        instance.step(0.0, H)


def test_getting_has_a_status_too(instance: Instance) -> None:
    number = "Real.in" if instance.model.fmi_version == 2 else "Float64.in"
    instance.set_values({number: 4.5})
    instance.set(trick=tricks.WARN_GET)
    assert instance.get(number)[0] == 4.5
    instance.set(trick=tricks.FAIL_GET)
    for name in (number, "String.in"):
        with pytest.raises(RunError, match="component every: get returned error"):
            instance.values([name])


def test_a_warning_of_the_first_of_two_calls_is_kept(tmp_path: Path) -> None:
    built = every(2, tmp_path)
    instance = Instance(built.component)
    instance.set(trick=tricks.WARN_SETUP)
    assert entry(instance, "enter_initialisation")(instance.pointer, 0.0, False, 0.0, 0.0) == 1
    instance.free()


# ---- after a fatal error ----


@pytest.mark.parametrize("trick", [tricks.FATAL, tricks.PENDING])
def test_nothing_is_called_after_a_fatal_error(tmp_path: Path, trick: int) -> None:
    """Nor while a step still runs that was said to be pending, which FMI 3 does not know."""
    for version in (2, 3) if trick == tricks.FATAL else (2,):
        folder = tmp_path / str(version)
        folder.mkdir()
        built = every(version, folder)
        instance = started(built)
        instance.set(trick=trick)
        with pytest.raises(RunError, match="fatal" if trick == tricks.FATAL else "Pending; asynchronous"):
            instance.step(0.0, H)
        for call in (instance.terminate, instance.reset, instance.get_state):
            with pytest.raises(RunError, match="returned fatal"):
                call()
        instance.free()
        assert counter(built, "every_after_fatal") == 0
        assert counter(built, "every_live") == 1  # it is left as it is


@pytest.mark.parametrize("version", [2, 3])
def test_a_run_leaves_an_fmu_alone_after_a_fatal_error(tmp_path: Path, version: int) -> None:
    """Also where the core calls the FMU's functions itself."""
    from orchestrator.run.simulate import simulate

    built = every(version, tmp_path, modes=False)
    with pytest.raises(RunError, match=r"component every failed .* fatal"):
        simulate(built.system, 5, parameters={"every.trick": tricks.FATAL}, trust=True)
    assert counter(built, "every_after_fatal") == 0
    assert counter(built, "every_live") == 1


def test_instances_are_freed_once(built: Every) -> None:
    before = counter(built, "every_live")
    with Instance(built.component) as first, Instance(built.component):
        assert counter(built, "every_live") == before + 2
        first.free()
        first.free()
    assert counter(built, "every_live") == before
    with pytest.raises(RunError, match="component every: its instance is freed"):
        first.get("trick")
    assert first.messages == []


# ---- messages ----


def test_the_last_messages_are_kept(instance: Instance) -> None:
    instance.set(trick=tricks.MANY)
    with pytest.raises(RunError, match="number 29"):
        instance.step(0.0, H)
    assert len(instance.messages) == MESSAGES
    assert [m.split(" (")[0] for m in instance.messages] == [f"number {k}" for k in range(10, 30)]


def test_fmi2_messages_are_formatted(tmp_path: Path) -> None:
    built = every(2, tmp_path)
    with started(built) as instance:
        instance.set(trick=tricks.MANY)
        raw_step(instance)
        assert instance.last_words() == "number 29 (42)"


def test_a_long_message_is_cut(instance: Instance) -> None:
    instance.set(trick=tricks.LONG)
    raw_step(instance)
    assert instance.last_words() == "m" * 511


def test_messages_cannot_move_the_cursor(instance: Instance) -> None:
    instance.set(trick=tricks.UGLY)
    raw_step(instance)
    assert instance.last_words().startswith("one two  [31mthree")
    assert instance.last_words().isprintable()


# ---- events ----


def test_events_are_iterated(built3: Every, apart: bool) -> None:
    with started(built3, apart) as instance:
        instance.set(trick=tricks.EVENT)
        assert instance.step(0.0, H).event
        instance.enter_event()
        first, second = instance.update_discrete(), instance.update_discrete()
        instance.enter_step()
        assert (first.more, first.next_event_defined) == (True, False)
        assert (second.more, second.next_event_defined, second.next_event) == (False, True, 12.5)
        assert instance.values(["events"]) == {"events": 1}


def test_clocks_tick_in_event_mode(built3: Every, apart: bool) -> None:
    with started(built3, apart) as instance:
        with pytest.raises(RunError, match="clocks tick in event mode"):
            instance.set_values({"Clock.in": True})
        for ticks in (1, 2):
            instance.enter_event()
            instance.set_values({"Clock.in": True})
            assert instance.values(["Clock.in", "Clock.out"]) == {"Clock.in": True, "Clock.out": False}
            instance.update_discrete()
            assert instance.values(["Clock.in", "Clock.out"]) == {"Clock.in": False, "Clock.out": True}
            instance.update_discrete()
            instance.enter_step()
            assert instance.values(["ticks"]) == {"ticks": ticks}


def test_fmi2_has_no_modes(tmp_path: Path) -> None:
    built = every(2, tmp_path)
    with started(built) as instance:
        for name in ("enter_event", "enter_step", "enter_configuration", "exit_configuration"):
            with pytest.raises(RunError, match="FMI 2 has no such mode"):
                instance.call(name)
        with pytest.raises(RunError, match="FMI 2 has no such mode"):
            instance.call("update_discrete", ctypes.byref(EventResult()))


# ---- state and derivatives ----


def test_states_go_back_and_over_as_bytes(instance: Instance) -> None:
    name = "Integer.in" if instance.model.fmi_version == 2 else "Int64.in"
    instance.set_values({name: 11, "String.in": "before"})
    state = instance.get_state()
    data = instance.serialize_state(state)
    instance.set_values({name: 12, "String.in": "after"})
    instance.set_state(state)
    assert instance.values([name, "String.in"]) == {name: 11, "String.in": "before"}
    instance.set_values({name: 13})
    instance.call("get_state", ctypes.byref(state))  # into the one there is
    instance.set_values({name: 14})
    instance.set_state(state)
    assert instance.values([name]) == {name: 13}
    other = instance.deserialize_state(data)
    instance.set_state(other)
    assert instance.values([name, "String.in"]) == {name: 11, "String.in": "before"}
    for s in (state, other):
        instance.free_state(s)
        assert s.value is None


@pytest.mark.parametrize("size", [0, 1, 100000])
def test_bytes_of_another_size_are_no_state(instance: Instance, size: int) -> None:
    with pytest.raises(RunError, match=r"deserialize returned error \(no state of mine"):
        instance.deserialize_state(b"s" * size)


def test_derivatives_of_arrays_have_one_number_for_each_element(built3: Every, apart: bool) -> None:
    with started(built3, apart) as instance:
        found = instance.directional_derivative(["Float64.array_out"], ["Float64.array_in"], [1.0, -2.0, 0.5])
        assert found.tolist() == [1.0, -2.0, 0.5]
        with pytest.raises(InputError, match="1 seeds are given for 3 knowns"):
            instance.directional_derivative(["Float64.array_out"], ["Float64.array_in"], [1.0])


def test_derivatives_of_fmi2(tmp_path: Path) -> None:
    built = every(2, tmp_path)
    with started(built) as instance:
        assert instance.directional_derivative(["Real.out", "Real.in"], ["Real.in"], [3.0]).tolist() == [3, 0]


def test_reset_and_terminate(instance: Instance) -> None:
    name = "Real.in" if instance.model.fmi_version == 2 else "Float64.in"
    instance.set_values({name: 4.0})
    instance.terminate()
    assert instance.get(name)[0] == 4.0
    instance.reset()
    assert instance.get(name)[0] == 0.0
    instance.enter_initialisation(stop_s=2.0, tolerance=1e-6)
    instance.exit_initialisation()

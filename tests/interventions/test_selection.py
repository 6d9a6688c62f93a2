from dvca_sumo.interventions import Gate, Selection, State
from interventions.scenes import occasion


def admitted(selection: Selection, states: list[State]) -> list[int]:
    """Indices that a gate lets through, of messages made every 0.1 s in these states."""
    gate = Gate(selection)
    messages = [occasion(index=index, elapsed=round(0.1 * index, 9), state=state) for index, state in enumerate(states)]
    return [one.message.index for one in messages if gate.admits(one)]


def rolling(count: int) -> list[State]:
    """One state further with every message."""
    return [State(position, 10, 0) for position in range(count)]


def test_an_empty_selection_admits_everything() -> None:
    assert admitted(Selection(), rolling(4)) == [0, 1, 2, 3]


def test_a_time_window_begins_with_its_start_and_ends_before_its_end() -> None:
    assert admitted(Selection(start=0.2, end=0.5), rolling(8)) == [2, 3, 4]


def test_an_index_range_contains_both_ends() -> None:
    assert admitted(Selection(first=2, last=4), rolling(8)) == [2, 3, 4]
    assert admitted(Selection(first=6), rolling(8)) == [6, 7]
    assert admitted(Selection(last=0), rolling(8)) == [0]


def test_a_state_admits_its_messages_at_every_visit() -> None:
    a, b = State(3, 5, 0), State(3, 5, -1)
    assert admitted(Selection(state=a), [a, b, a, b]) == [0, 2]


def test_from_a_state_on_everything_is_admitted() -> None:
    assert admitted(Selection(from_state=State(3, 10, 0)), rolling(6)) == [3, 4, 5]


def test_a_reached_state_stays_reached_when_the_ego_leaves_it_again() -> None:
    a, b = State(3, 5, 0), State(3, 4, 0)
    assert admitted(Selection(from_state=b), [a, b, a, a]) == [1, 2, 3]


def test_a_skipped_state_counts_as_reached_at_the_first_place_past_it() -> None:
    states = [State(2, 10, 0), State(3, 10, 1), State(4, 10, 0), State(3, 10, 0)]
    assert admitted(Selection(from_state=State(3, 10, 0)), states) == [2, 3]


def test_a_state_that_is_never_reached_admits_nothing() -> None:
    assert admitted(Selection(from_state=State(9, 0, 0)), rolling(5)) == []


def test_a_state_is_reached_also_by_messages_that_another_condition_holds_back() -> None:
    selection = Selection(first=4, from_state=State(1, 10, 0))
    assert admitted(selection, [*rolling(3), *rolling(3)]) == [4, 5]


def test_all_conditions_hold_together() -> None:
    selection = Selection(start=0.1, end=0.6, first=2, last=9, state=State(5, 10, 0))
    assert admitted(selection, rolling(10)) == [5]
    assert admitted(Selection(start=0.3, last=1), rolling(10)) == []


def test_two_gates_of_one_selection_know_nothing_of_each_other() -> None:
    selection = Selection(from_state=State(1, 10, 0))
    assert admitted(selection, rolling(3)) == [1, 2]
    assert admitted(selection, rolling(1)) == []

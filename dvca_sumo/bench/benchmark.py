"""The whole benchmark: cases in, scores out, nothing that was found is lost."""

from collections.abc import Callable, Sequence

from dvca_sumo.bench.cases import Case
from dvca_sumo.bench.places import contents_of
from dvca_sumo.bench.runs import Setting, analysed
from dvca_sumo.bench.score import FAILED, Score
from dvca_sumo.report.result import versions
from dvca_sumo.store import Store, key_of

OnScore = Callable[[Score, int, bool], None]  # a case's score, how many are left, whether it was not known before


def run_benchmark(
    cases: Sequence[Case], settings: Sequence[Setting], jobs: int, store: Store[Score] | None, on_score: OnScore
) -> list[Score]:
    """The scores of all cases under each setting, in their order.

    What the store holds already is not run again, and told first; what is found is kept there at once. A case
    that could not be analysed is not kept: the next run tries it again.
    """
    asked = [(case if setting.repeats is None else case.loosened(), setting) for setting in settings for case in cases]
    known = {row: score for row, pair in enumerate(asked) if store and (score := store.find(question_key(*pair)))}
    left = len(asked) - len(known)
    for score in known.values():
        on_score(score, left, False)
    for setting in settings:
        rows = [row for row, pair in enumerate(asked) if pair[1] is setting and row not in known]
        for number, score in analysed([asked[row][0] for row in rows], setting, jobs):
            known[rows[number]] = score
            left -= 1
            if store is not None and score.verdict != FAILED:
                store.add(question_key(*asked[rows[number]]), score)
            on_score(score, left, True)
    return [known[row] for row in range(len(asked))]


def question_key(case: Case, setting: Setting) -> str:
    """Under which the score of a case is kept."""
    contents = [contents_of(scenario) for scenario in (case.scenario, case.harmless_scenario) if scenario]
    asked = (setting.seed, setting.repeats, setting.has_controls, setting.baselines)
    return key_of([case, contents, asked, versions()])

"""What the oracles hold a run against."""

import msgspec


class Thresholds(msgspec.Struct, frozen=True):
    """Parameters of all oracles; a scenario overrides them by `dvca.<field>` parameters.

    The defaults leave a careful driver alone: each tolerance is wider than what estimation noise
    and control error of a healthy stack amount to, and far narrower than what a fault does.
    """

    # safety
    safe_distance: float = 0.2  # [m] closer than this to anything while moving is a violation; 0: contact only
    standing_speed: float = 0.1  # [m/s] at or below it the ego stands
    ttc: float = 0.5  # [s] a contact nearer than this at constant velocities is a violation
    ttc_dwell: float = 0.2  # [s] for so long without a break: two cars that pass in a bend are no hazard
    ttc_speed: float = 1.0  # [m/s] a slower ego's time to collision is not judged

    # traffic rules
    speed_tolerance: float = 1.0  # [m/s] above the limit
    speed_dwell: float = 1.0  # [s] for so long without a break
    lane_tolerance: float = 0.3  # [m] a corner of the ego beyond the edge of what it may drive on
    lane_dwell: float = 0.3  # [s] for so long without a break
    red_light_tolerance: float = 2.0  # [m] front bumper beyond the stop line that was passed on red
    stop_line_tolerance: float = 0.5  # [m] front bumper of a stopped ego beyond the stop line
    stop_line_dwell: float = 1.0  # [s] resting there on red for so long
    stop_line_zone: float = 3.0  # [m] a stop counts from so far before the stop line
    stop_speed: float = 0.3  # [m/s] slower is a stop

    # mission
    destination_tolerance: float = 3.0  # [m] front bumper before or beyond the destination
    no_progress_time: float = 30.0  # [s] without a reason to wait
    no_progress_distance: float = 1.0  # [m] less than this in that time is no progress

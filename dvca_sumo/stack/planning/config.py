"""All parameters of planning."""

import msgspec


class PlanningConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the ego is to drive; the numbers describe a calm driver and belong to no scenario."""

    # Start: how far the believed pose may be from the previous trajectory for the plan to go on from there.
    stitch_lateral: float = 0.5  # [m] what control leaves in a curve
    stitch_longitudinal: float = 1.5  # [m] what actuator lag leaves when the speed changes
    stitch_heading: float = 0.2  # [rad]
    stitch_speed: float = 2.5  # [m/s]
    off_route: float = 15.0  # [m] from the reference line: what a turn too tight for the ego leaves it at, and more
    astray_speed: float = 3.0  # [m/s] while the ego points elsewhere than any smooth path back to the line

    # Limits of motion.
    cruise_fraction: float = 0.97  # of the speed limit: room for what control overshoots ...
    cruise_room: float = 0.42  # [m/s] ... which is no more than that, however fast
    acceleration: float = 2.0  # [m/s^2] comfort
    braking: float = 1.2  # [m/s^2] b of the intelligent driver model: stops then take about twice that
    slowing: float = 2.0  # [m/s^2] before curves and lower limits
    comfort_braking: float = 2.5  # [m/s^2] not exceeded unless there is no other way
    hard_braking: float = 7.5  # [m/s^2] what dry asphalt allows with something in reserve
    jerk: float = 4.0  # [m/s^3] comfort
    hard_jerk: float = 20.0  # [m/s^3] when braking harder than comfort
    lateral_acceleration: float = 2.5  # [m/s^2] in curves
    steering: float = 0.5  # [rad] of the front wheels, going round something in a bend
    steering_rate: float = 0.45  # [rad/s] of the front wheels, on the way into a curve and out of it
    shift_acceleration: float = 1.2  # [m/s^2] when moving sideways
    hard_shift_acceleration: float = 2.5  # [m/s^2] when there is no room for comfort
    curvature: float = 0.15  # [1/m] of a sideways move at low speed: within the steering of a car

    # Distances kept lengthwise, from the front bumper.
    stop_line_gap: float = 0.8  # [m] before a stop line ...
    crossing_gap: float = 1.5  # [m] ... and before the pedestrian crossing behind it: people step beside that, too
    object_gap: float = 5.0  # [m] behind what stands: leaves room to pull out later
    yield_gap: float = 2.0  # [m] before the way of a crossing vehicle
    person_gap: float = 3.0  # [m] before the way of a crossing person
    follow_gap: float = 4.0  # [m] behind a leader that stops: still enough to pull out
    headway: float = 1.2  # [s] behind a moving leader

    # Distances kept sideways, from the side of the body.
    object_margin: float = 0.3  # [m] closer than this counts as in the way
    bicycle_margin: float = 0.6  # [m] bicycles sway
    person_margin: float = 0.35  # [m] of people who stand or walk along the road ...
    creeping_speed: float = 1.5  # [m/s] ... but slower, `object_margin` of those who stand, at walking pace
    setting_off_margin: float = 0.5  # [m] of people who walk, for an ego that stands
    person_least: float = 0.25  # [m] of people who stand beside the body: it stays until they go
    crossing_person_margin: float = 1.0  # [m] of people who walk across
    crossing_margin: float = 2.0  # [m] of people who walk across at a pedestrian crossing
    person_slow_gap: float = 1.5  # [m] slow down when passing people closer than this
    object_slow_gap: float = 0.8  # [m] slow down when passing standing objects closer than this
    lateral_buffer: float = 0.1  # [m] that what stands is taken to be wider on each side, where it bounds the path
    buffer_before: float = 3.0  # [m] and longer, towards the ego
    buffer_behind: float = 2.0  # [m] and on its far side

    # Nudging: going around what stands, within the lanes of our direction.
    nudge_clearance: float = 0.7  # [m] wanted sideways
    nudge_clearance_least: float = 0.4  # [m] accepted where the road is narrow; more than what counts as in the way
    person_clearance: float = 1.2  # [m] wanted beside people
    edge_clearance: float = 0.2  # [m] to the edge of the road
    nudge_hold: float = 0.15  # [m] smaller changes of a target are taken for noise
    standing_speed: float = 0.5  # [m/s] slower than this is standing: above the noise of a tracker
    lingering_speed: float = 0.3  # [m/s] slower than this is standing of a person who has walked: it may walk on
    moving_speed: float = 1.0  # [m/s] a vehicle that has stood counts as moving from here: the noise is on both sides
    parked_after: float = 3.0  # [s] of standing before the ego leaves its lane for a vehicle or person
    person_patience: float = 4.0  # [s] of standing at a crossing, before the ego leaves its lane for a person
    broken_down_after: float = 120.0  # [s] of standing in the lane, if it may be in a queue
    queue_reach: float = 30.0  # [m] before a stop line, a vehicle that stands may be waiting
    queue_length: float = 100.0  # [m] before a stop line, a vehicle that stands may be behind others that it hides
    queue_gap: float = 12.0  # [m] to the next vehicle ahead, a vehicle that stands may be waiting

    # Changing lanes for the route.
    change_gap: float = 2.0  # [m] to who is in front or behind on the next lane, at least
    change_headway: float = 0.4  # [s] and behind whoever follows the other
    change_braking: float = 2.0  # [m/s^2] at most, of the one behind
    change_hurry: float = 4.0  # [s] before the last place for it, gaps are taken that leave no headway at all
    change_time: float = 3.0  # [s] in which the ego falls back beside a gap
    change_outlook: float = 50.0  # [m] before it can begin, gaps are looked for

    # Passing who is slow on the next lane.
    passing_gain: float = 2.0  # [m/s] one gets on faster there
    passing_slowest: float = 8.0  # [m/s] slower ones are a queue, may be one for where the ego goes
    passing_outlook: float = 8.0  # [s] in which one would be caught up with
    passing_room: float = 12.0  # [s] at the speed wanted, that there is still room to pass somebody
    return_room: float = 10.0  # [s] of room left, from where on the ego comes back to its own lane, if it has to

    # Whose turn it is.
    likely: float = 0.15  # probability from which a hypothesis counts: that of a turn at most junctions
    possible: float = 0.05  # probability from which it counts when it happens within `soon`
    soon: float = 1.5  # [s]
    pass_margin: float = 1.5  # [s] ahead of someone with priority
    pass_margin_prior: float = 0.5  # [s] ahead of someone who should have waited but cannot
    pass_hold: float = 0.5  # [s] less margin is accepted by a decision already taken
    clear_margin: float = 0.5  # [s] behind someone who has crossed
    expected_reaction: float = 0.5  # [s] of those who have to give way to the ego
    expected_braking: float = 4.5  # [m/s^2] and of them, after that
    give_way_speed: float = 8.0  # [m/s] at a line where others may have priority
    peering_speed: float = 2.0  # [m/s] past such a line, where others hide who may come

    # Signals and signs.
    yellow_braking: float = 3.0  # [m/s^2] yellow means stop unless it takes more
    signal_memory: float = 2.0  # [s] a signal out of view keeps its colour
    unseen_reach: float = 20.0  # [m] beyond braking distance, where a signal should have been seen
    unseen_patience: float = 5.0  # [s] standing at a signal never seen before it is taken for dark
    sign_wait: float = 1.0  # [s] standing at a stop sign
    sign_patience: float = 8.0  # [s] standing at a stop sign for a single other one who was there first
    watch_before: float = 5.0  # [m] before another approach's stop sign, at most, who stands there is waiting at it
    watch_beside: float = 0.0  # [m] from that lane's centre line, at most; on the lane in any case
    watch_until: float = 10.0  # [m] from that stop sign, those who waited there have left

    # Where the map has no speed limit.
    urban_limit: float = 13.89  # [m/s]
    motorway_limit: float = 27.78  # [m/s]
    speed_bound: float = 40.0  # [m/s] of the vehicle, whatever the road

    # Real bugs (see stack/bugs.py): what the build does wrong.
    trusts_lane_room: bool = False  # passes what leaves enough of the lane, however close the path runs
    lines_at_rear_axle: bool = False  # takes the station of a stop line for where the rear axle is to stop
    unmapped_at_bound: bool = False  # drives at `speed_bound` where the map has no limit
    stops_past_objects: bool = False  # stops `object_gap` past the near end of what stands, not before it
    projects_x_twice: bool = False  # looks for the destination on the route at (x, x) instead of (x, y)

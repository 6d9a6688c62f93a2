"""What holds of every route, whatever the net."""

import numpy as np
import pytest

from dvca_sumo.roadmap import Route


def check_sound(route: Route) -> None:
    steps = np.diff(route.line.stations)
    assert steps[:-1] == pytest.approx(1.0)
    assert 0.2 < steps[-1] < 1.4
    assert np.isfinite(route.line.points).all()
    assert len(route.lane_ids) == len(route.line.points)
    for array in (route.lane_left, route.lane_right, route.road_left, route.road_right, route.speed_limits):
        assert len(array) == len(route.line.points)
        assert not array.flags.writeable
    assert (route.road_left >= route.lane_left).all()
    assert (route.lane_left > 0.0).all()
    assert (route.lane_right < 0.0).all()
    assert (route.road_right <= route.lane_right).all()
    assert 0.0 < route.start <= route.destination <= route.line.length + 1e-6
    stations = [line.station for line in route.stop_lines]
    assert stations == sorted(stations)
    assert all(line.station <= line.exit_station for line in route.stop_lines)

"""Which vehicles there are in the simulation."""

import libsumo

SHADOW = "dvca.shadow"  # vehicle type of what stands for an ego on a second lane


def has(vehicle: str) -> bool:
    """Whether the vehicle is in the simulation (loaded, inserted or not yet, and not removed)."""
    try:
        libsumo.vehicle.getRoadID(vehicle)
    except libsumo.TraCIException:
        return False
    return True


def shadow_of(ego: str, lane: str) -> str:
    """The name of an ego's shadow on a lane; without the colon of junctions, which SUMO's devices stumble over."""
    return f"{SHADOW}.{lane.replace(':', '~')}.{ego}"


def is_shadow(name: str) -> bool:
    """Whether it is the name of one."""
    return name.startswith(f"{SHADOW}.")

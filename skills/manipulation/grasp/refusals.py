"""Why an object is not grasped, in a sentence that names the cause: too heavy, too wide, too flat."""

from __future__ import annotations

from skills.api import ObjectObservation
from skills.manipulation.grasp.candidates import Target, least_height_m, narrowest_m
from skills.perception.class_forms import class_forms
from skills.robot import FloatArray, GripperCapabilities


def least_mass_kg(seen: ObjectObservation) -> float:
    """What an object weighs at least, by its class and the size seen; 0.0 where nothing is known of its class."""
    form = class_forms().get(seen.kind.name)
    return 0.0 if form is None else form.least_mass_kg(seen.size_m)


def known_too_heavy(seen: ObjectObservation, max_payload_kg: float) -> str | None:
    """Why the arm cannot carry an object, known before it is lifted; None: it can, or only weighing tells."""
    mass_kg = least_mass_kg(seen)
    if mass_kg <= max_payload_kg:
        return None
    return f"the {seen.kind} weighs {mass_kg:.1f} kg at least, and the arm carries {max_payload_kg:.1f} kg at most"


def without_grasp(target: Target, p_BS: FloatArray, gripper: GripperCapabilities, name: str) -> str:
    """Why an object for which there are no grasp candidates has none. p_BS is the shoulder."""
    width_m = narrowest_m(target, p_BS)
    if width_m is not None and width_m >= gripper.max_grasp_m:
        return (
            f"the {name} is too wide for the gripper: {1000 * width_m:.0f} mm where it is narrowest, "
            f"and the gripper takes less than {1000 * gripper.max_grasp_m:.0f} mm"
        )
    least_m = least_height_m(target, p_BS, gripper)
    if least_m is not None:
        return (
            f"the {name} is too flat for the gripper: {1000 * target.height_m:.0f} mm high, "
            f"and the fingers need {1000 * least_m:.0f} mm"
        )
    return f"the fingers find no hold on the {name}: no part of its outline is straight over their breadth"

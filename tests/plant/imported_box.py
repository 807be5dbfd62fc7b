"""The folder of an imported object, written without the importer: a box."""

from plant.models.catalogue import ImportedObject

SDF = """<sdf version="1.9"><model name="{name}"><link name="{name}">
<inertial><mass>{mass}</mass><inertia><ixx>0.001</ixx><iyy>0.004</iyy><izz>0.004</izz></inertia></inertial>
<collision name="box"><geometry><box><size>0.2 0.06 0.04</size></box></geometry></collision>
</link></model></sdf>
"""


def write_box(folder, name, class_name, mass_kg=1.2):
    """Writes the model of a box of 0.2 x 0.06 x 0.04 m into a new folder; returns the folder."""
    folder.mkdir()
    (folder / f"{name}.sdf").write_text(SDF.format(name=name, mass=mass_kg))
    facts = {"mass_kg": mass_kg, "com_m": (0.0, 0.0, 0.0), "inertia_kg_m2": (0.001, 0.004, 0.004, 0.0, 0.0, 0.0)}
    size = {"size_m": (0.2, 0.06, 0.04), "collision_parts": 1, "triangles": 12}
    ImportedObject(name=name, class_name=class_name, **facts, **size).write(folder)
    return folder

from executive.mission.class_ids import CLASS_IDS
from plant.models.catalogue import load_catalogue


def test_the_language_and_the_models_number_the_classes_alike():
    catalogue = {name: entry.id for name, entry in load_catalogue().items()}
    assert {name: CLASS_IDS[name] for name in catalogue} == catalogue

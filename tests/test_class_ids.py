from executive.class_ids import CLASS_IDS
from plant.models.catalogue import load_catalogue
from skills.detect.appearance import load_appearance


def test_the_language_and_the_models_number_the_classes_alike():
    catalogue = {name: entry.id for name, entry in load_catalogue().items()}
    assert {name: CLASS_IDS[name] for name in catalogue} == catalogue


def test_the_detector_numbers_the_classes_alike():
    appearance = {name: each.id for name, each in load_appearance().classes.items()}
    assert {name: CLASS_IDS[name] for name in appearance} == appearance

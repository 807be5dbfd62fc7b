"""The referee, which alone knows the true state of the plant: it observes a run and judges its goal conditions."""

from plant.referee.referee import Referee

__all__ = ["Referee"]

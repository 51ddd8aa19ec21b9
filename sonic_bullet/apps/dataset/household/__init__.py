"""Household: sounds of things as people own them, struck or dropped, in rooms, by microphones.

    HouseholdOptions -> recipe_of -> Recipe, four lines that hold the options by value       recipe
    seeds of a clip, one a part -> draw_clip -> HouseholdClip, its numbers the columns       clips
        object: kind, ratios -> Shape                                                        objects
        its modes and radiation, solved once for all sizes                                   solved
        material within its preset's spread                                                  materials
        how it is held, or what it lies on; what strikes it                                  holding, strikers
    HouseholdClip -> contact log, by arrays or by PyBullet -> the run time -> pascals        sounding
        -> a drawn room's response, ambient noise, a drawn microphone                        surroundings

Each part of a clip draws from a generator of its own, so that a counterfactual is the same clip with one other seed.
"""

from sonic_bullet.apps.dataset.household.recipe import household_recipe, recipe_of

__all__ = ["household_recipe", "recipe_of"]

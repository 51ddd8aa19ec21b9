"""Run time: physics steps in, frames of sound out; live, in blocks and from a log, with the same bits.

    replay: a contact log to sound | synthesizer: live steps to frames | clock: steps and samples
    src/runtime/driver: all stages in one call | synthesis_state: setup and state; tables, body_table: its tables
    body_lifetime: bodies that come and go | supports: poles of bodies on others | residual_voice: residuals
    channels: sensors' weights, images, and what is added to their sound | ringing_on: tail after the last step
    body_stems: a stem per body | silence: reasons why nothing is heard

What the stages compute is in src/: forces in contact, modes in bank, pressure in path.
"""

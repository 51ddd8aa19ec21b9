"""The ladders of scenes of the draft glTF extension KHR_audio_rigid_bodies, run here and held against its text."""

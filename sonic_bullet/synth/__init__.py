"""Arrays in, arrays out, state explicit: loads become strikes and rubbing, forces become modal motion, motion becomes
pressure.

strikes, pulse: what an impact is | surface_kernel, profile: rolling and sliding | bank: the modes | path: to the
microphone
"""

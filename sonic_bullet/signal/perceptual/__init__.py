"""How loud a sound is to an ear, over time and frequency [Ren, Yeh, Lin 2013, section 4.3]."""

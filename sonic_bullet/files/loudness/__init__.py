"""How loud a sound is and how it is brought to a level: its meter, its true peak, fades and the limiter."""

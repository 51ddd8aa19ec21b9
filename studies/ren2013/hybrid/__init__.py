"""The hybrid metric Π of damped sinusoids and a recording [Ren, Yeh, Lin 2013, sec. 4.3]: what a search goes down."""

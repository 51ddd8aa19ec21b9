"""Commands over many cases: CASE folders -> jobs, on this machine or a cluster -> a folder a case, a table of all."""

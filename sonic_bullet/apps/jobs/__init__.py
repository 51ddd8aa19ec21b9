"""Many jobs, in any order and whatever dies: each is done once, and what fails three times is listed with its reason.

    jobs without a result -> processes (job_processes) or a Dask cluster (cluster_jobs) -> result, or the reason
        -> job_driver -> files in a folder (job_folder), lists, summary

A job depends on its item alone, so that workers, order and interruptions change no byte. `dataset` makes samples so,
`fit` and `diagnose` many cases.
"""

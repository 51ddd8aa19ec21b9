"""A folder that an editor opens: mix, stems, film and events on one timeline, to the sample.

AudioReports, FilmReport, events -> Timeline (timeline.py) -> session.otio  (otio_timeline.py)
                                                           -> session.rpp   (reaper_project.py)
"""

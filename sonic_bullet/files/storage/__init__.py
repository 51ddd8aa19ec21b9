"""What goes to disk and comes back: atomic files, private folders, cache, spools, containers of arrays, typed JSON.

    file that a user named    atomic: locked unfinished file -> fsync -> os.replace; the old file or the whole new one
    computed again if lost    cache: arrays under a hash of their inputs, in a private folder (user_folder), bounded
    longer than the memory    spool: rows in a nameless temporary file; spooled_sound: sound on top of it
    arrays with one header    container: npz without pickle, sizes compared before anything is allocated
    record <-> JSON           json_records: one door for every format; typed_json, unread say what does not fit it
    text of a user            reading: any exception becomes one line of this package's own errors
    where a process is killed leftovers: temporary files and folders, that its supervisor removes

Nothing here knows what a sound, a log or a model is; `sonic_bullet.files` does.
"""

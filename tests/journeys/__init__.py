"""Ways of use, walked by the command line as a user walks them: a file a road. They run first, and are fast."""

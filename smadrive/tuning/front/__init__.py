"""The front process: it owns the port of the page, answers OFF, and passes page loads on to the page process.

It may import tornado, files, `tuning.link` and `stream`; never bokeh, scipy or the session, because it must start and
answer at once.
"""

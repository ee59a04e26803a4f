"""The console: a page in the browser that drives a device.

page        the page itself: plain ES modules, HTML and CSS, no build step
page_files  what of it is served, with the protocol's numbers and the rig file's schema in it
server      serves the page on this computer alone, and connects it with the device
bridge      carries the page's bytes to the device's port and back, and stops jogs when it has gone
scripts     what is run on the board's REPL
board_work  what the page asks of the board's REPL: rig file, load
"""

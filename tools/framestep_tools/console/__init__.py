"""The console: a page in the browser that drives a device.

page            the page itself: plain ES modules, HTML and CSS, no build step
page_files      the page's files as served, with the protocol's numbers and the rig file's schema
server          serves the page on this computer alone, and connects it with the device
port_bridge     carries bytes between the page and the device's port, and stops jogs without a page
repl_scripts    scripts for the board's REPL
board_requests  the page's requests to the board's REPL: rig file, load
"""

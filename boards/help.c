// What help() says on the REPL of a board with framestep, instead of the port's own text, which is 2 kB longer.
const char framestep_help_text[] =
    "framestep runs on this board. For its commands:\n"
    "  import framestep.repl\n"
    "  help()\n\n"
    "CTRL-C interrupts a program, CTRL-D soft-resets, CTRL-E begins a paste;\n"
    "CTRL-A and CTRL-B begin and end the raw REPL.\n"
    "help(x) tells about x, help('modules') lists what can be imported.\n";

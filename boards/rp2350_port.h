// MicroPython's settings for the rp2 port, with framestep's own text for help()
#include <mpconfigport.h>

#undef MICROPY_PY_BUILTINS_HELP_TEXT
#define MICROPY_PY_BUILTINS_HELP_TEXT framestep_help_text // help.c

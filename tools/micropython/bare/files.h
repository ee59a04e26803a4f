#include "py/obj.h"

void files_init(void);  // opens standard input and output
void files_flush(void);  // writes what was printed
void files_mount(void);  // makes the computer's files those of a script

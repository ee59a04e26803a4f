#include "py/obj.h"

void files_init(void);  // opens standard input and output
void files_flush(void);  // writes what was printed

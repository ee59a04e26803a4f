#include "../framestep.h"

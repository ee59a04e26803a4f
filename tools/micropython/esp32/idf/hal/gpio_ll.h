#include "hal/gpio_types.h"

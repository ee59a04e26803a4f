#include "hal/timer_hal.h"

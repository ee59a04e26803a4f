// Nothing of it is needed: see driver/ledc.h.

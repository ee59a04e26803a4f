#include "esp_private/esp_clk_tree_common.h"

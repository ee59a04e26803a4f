// A board without names for its pins.
extern const mp_obj_dict_t machine_pin_board_pins_locals_dict;

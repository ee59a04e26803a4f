// Viper code for Thumb: part of py/emitnative.c, before emit_native_start_pass().
//
// MicroPython's own emitter moves each value to memory before the next one is loaded, makes a 0 or a 1 of each
// comparison to test it again, and takes the longest form of each forward jump. Here values stay in r0 to r3 while there
// is room, constants are part of an instruction where they fit, jumps test the flags, and the local variables that are
// used most are in registers.

// ---------------------------------------------------------------- local variables

// Registers of local variables: r6 only where no name is looked up
#define MAX_LOW_PLACES (3)
static const uint8_t thumb_low_regs[MAX_LOW_PLACES] = {REG_LOCAL_1, REG_LOCAL_2, REG_LOCAL_3};
// r8 to r11 hold more of them, if these are used that often: a function has to save these registers
#define HIGH_PLACES (4)
#define HIGH_USES (40)

static void need_reg_single(emit_t *emit, int reg_needed, int skip_stack_pos);
static void need_reg_all(emit_t *emit);
static vtype_kind_t load_reg_stack_imm(emit_t *emit, int reg_dest, const stack_info_t *si, bool convert_to_pyobj);
static void adjust_stack(emit_t *emit, mp_int_t stack_size_delta);
static stack_info_t *peek_stack(emit_t *emit, mp_uint_t depth);
static vtype_kind_t peek_vtype(emit_t *emit, mp_uint_t depth);
static void emit_pre_pop_reg(emit_t *emit, vtype_kind_t *vtype, int reg_dest);
static void emit_post_push_reg(emit_t *emit, vtype_kind_t vtype, int reg);

// Return the local variable that is used most of those without a place.
static size_t thumb_most_used(emit_t *emit, size_t count) {
    size_t best = count;
    for (size_t i = 0; i < count; i++) {
        if (emit->thumb.place[i] == count
            && (best == count || emit->thumb.uses[i] > emit->thumb.uses[best])) {
            best = i;
        }
    }
    return best;
}

// Choose the places of a viper function's local variables once it is known how often each is used: first the registers
// of thumb_local_reg(), in that order, then those in memory.
static void thumb_place_locals(emit_t *emit) {
    size_t count = emit->scope->num_locals;
    uint16_t *place = emit->thumb.place;
    size_t low = emit->thumb.needs_qstrs ? MAX_LOW_PLACES - 1 : MAX_LOW_PLACES;
    size_t next = 0;
    uint uses_of_high = 0;
    for (size_t i = 0; i < count; i++) {
        place[i] = count;
    }
    while (next < count && next < low + HIGH_PLACES) {
        size_t i = thumb_most_used(emit, count);
        if (next >= low) {
            uses_of_high += emit->thumb.uses[i];
        }
        place[i] = next++;
    }
    emit->thumb.low_places = MIN(low, next);
    emit->thumb.high_places = 0;
    emit->as->saves_high = uses_of_high >= HIGH_USES;
    if (emit->as->saves_high) {
        emit->thumb.high_places = next - low;
    }
    for (size_t i = 0; i < count; i++) {
        if (place[i] == count) {
            place[i] = next++;
        }
    }
}

// To be called at the start of each pass.
static void thumb_start_pass(emit_t *emit, pass_kind_t pass) {
    emit->thumb.compared_end = emit->thumb.stored_end = emit->thumb.flags_end = emit->thumb.made_end = 0;
    asm_thumb_start_pass(emit->as, pass);
    size_t count = emit->scope->num_locals;
    if (emit->thumb.alloc < count) {
        emit->thumb.uses = m_renew(uint16_t, emit->thumb.uses, emit->thumb.alloc, count);
        emit->thumb.place = m_renew(uint16_t, emit->thumb.place, emit->thumb.alloc, count);
        emit->thumb.alloc = count;
    }
    if (pass == MP_PASS_STACK_SIZE) {
        for (size_t i = 0; i < count; i++) {
            emit->thumb.uses[i] = 0;
            emit->thumb.place[i] = i;
        }
        emit->thumb.needs_qstrs = false;
        emit->thumb.low_places = emit->thumb.high_places = 0;
        emit->as->saves_high = false;
    } else if (pass == MP_PASS_CODE_SIZE && emit->do_viper_types && CAN_USE_REGS_FOR_LOCALS(emit)) {
        thumb_place_locals(emit);
    }
}

// Return the register of a local variable of a viper function, -1 if it is in memory.
static int thumb_local_reg(emit_t *emit, size_t local_num) {
    int place = emit->thumb.place[local_num];
    if (place < emit->thumb.low_places) {
        return thumb_low_regs[place];
    }
    place -= emit->thumb.low_places;
    return place < emit->thumb.high_places ? ASM_THUMB_REG_R8 + place : -1;
}

// Return where on the C stack a local variable of a viper function is that is in memory.
static int thumb_local_index(emit_t *emit, size_t local_num) {
    return LOCAL_IDX_LOCAL_VAR(emit, emit->thumb.place[local_num]);
}

// Put a viper function's arguments where its local variables are.
static void thumb_store_arguments(emit_t *emit) {
    int count = emit->scope->num_pos_args;
    int last = -1; // the one whose place is REG_LOCAL_LAST, which points to the arguments
    for (int k = 0; k <= count; k++) {
        int i = k < count ? k : last;
        int reg = i < 0 ? -1 : thumb_local_reg(emit, i);
        if (i < 0) {
            break;
        }
        if (k < count && reg == REG_LOCAL_LAST) {
            last = i;
            continue;
        }
        ASM_LOAD_REG_REG_OFFSET(emit->as, REG_ARG_1, REG_LOCAL_LAST, i);
        if (emit->local_vtype[i] != VTYPE_PYOBJ) {
            emit_call_with_imm_arg(emit, MP_F_CONVERT_OBJ_TO_NATIVE, emit->local_vtype[i], REG_ARG_2);
        }
        if (reg < 0) {
            emit_native_mov_state_reg(emit, thumb_local_index(emit, i), REG_RET);
        } else {
            ASM_MOV_REG_REG(emit->as, reg, REG_RET);
        }
    }
}

// ---------------------------------------------------------------- values on the stack

static bool is_temporary(int reg) {
    return reg <= ASM_THUMB_REG_R3;
}

static int uses_of_reg(emit_t *emit, int reg) {
    int uses = 0;
    for (int i = 0; i < emit->stack_size; i++) {
        stack_info_t *si = &emit->stack_info[i];
        uses += si->kind == STACK_REG && si->data.u_reg == reg;
    }
    return uses;
}

// Return a register of r0 to r3 that no value is in. If there is none, the lowest such value goes to memory.
static int free_reg(emit_t *emit) {
    for (int reg = ASM_THUMB_REG_R0; reg <= ASM_THUMB_REG_R3; reg++) {
        if (uses_of_reg(emit, reg) == 0) {
            return reg;
        }
    }
    int i = 0;
    while (emit->stack_info[i].kind != STACK_REG || !is_temporary(emit->stack_info[i].data.u_reg)) {
        i++;
    }
    int reg = emit->stack_info[i].data.u_reg;
    need_reg_single(emit, reg, 0);
    return reg;
}

// Return the register that a value is in, or is put into. pos: 1 for the top of the stack.
static int stack_reg(emit_t *emit, int pos) {
    stack_info_t *si = &emit->stack_info[emit->stack_size - pos];
    if (si->kind != STACK_REG) {
        int reg = free_reg(emit);
        if (si->kind == STACK_VALUE) {
            emit_native_mov_reg_state(emit, reg, emit->stack_start + emit->stack_size - pos);
        } else {
            load_reg_stack_imm(emit, reg, si, false);
        }
        si->kind = STACK_REG;
        si->data.u_reg = reg;
    }
    return si->data.u_reg;
}

// Return the register for a result: that of a value just popped, if nothing else is in it, or a free one.
static int result_reg(emit_t *emit, int popped) {
    return is_temporary(popped) && uses_of_reg(emit, popped) == 0 ? popped : free_reg(emit);
}

// Return the register for a value made of one on the stack, which stays there.
static int changed_reg(emit_t *emit, int reg) {
    return is_temporary(reg) && uses_of_reg(emit, reg) == 1 ? reg : free_reg(emit);
}

// Find a number that is known. pos: as in stack_reg().
static bool is_constant(emit_t *emit, int pos, mp_int_t *value) {
    stack_info_t *si = &emit->stack_info[emit->stack_size - pos];
    if (si->kind != STACK_IMM || (si->vtype != VTYPE_INT && si->vtype != VTYPE_UINT)) {
        return false;
    }
    *value = si->data.u_imm;
    return true;
}

static size_t code_end(emit_t *emit) {
    return mp_asm_base_get_code_pos(&emit->as->base);
}

// Push the result of an instruction that has set the flags by it.
static void push_flagged(emit_t *emit, vtype_kind_t vtype, int reg) {
    emit->thumb.flags_end = code_end(emit);
    emit->thumb.flags_reg = reg;
    emit_post_push_reg(emit, vtype, reg);
}

// Push the result of an instruction that asm_thumb_redirect() can change.
static void push_made(emit_t *emit, vtype_kind_t vtype, int reg) {
    emit->thumb.made_end = code_end(emit);
    emit->thumb.made_reg = reg;
    emit_post_push_reg(emit, vtype, reg);
}

static void push_made_and_flagged(emit_t *emit, vtype_kind_t vtype, int reg) {
    push_made(emit, vtype, reg);
    emit->thumb.flags_end = emit->thumb.made_end;
    emit->thumb.flags_reg = reg;
}

// ---------------------------------------------------------------- operations

static void thumb_load_fast(emit_t *emit, vtype_kind_t vtype, int local_num) {
    emit->thumb.uses[local_num] += emit->pass == MP_PASS_STACK_SIZE;
    int from = thumb_local_reg(emit, local_num);
    if (from >= 0 && from < ASM_THUMB_REG_R8) {
        emit_post_push_reg(emit, vtype, from);
        return;
    }
    if (emit->thumb.stored_end == code_end(emit) && emit->thumb.stored_local == local_num) {
        emit_post_push_reg(emit, vtype, emit->thumb.stored_reg);
        return;
    }
    int reg = free_reg(emit);
    if (from >= 0) {
        ASM_MOV_REG_REG(emit->as, reg, from);
    } else {
        emit_native_mov_reg_state(emit, reg, thumb_local_index(emit, local_num));
    }
    emit_post_push_reg(emit, vtype, reg);
}

// Return the type of what was stored.
static vtype_kind_t thumb_store_fast(emit_t *emit, int local_num) {
    emit->thumb.uses[local_num] += emit->pass == MP_PASS_STACK_SIZE;
    vtype_kind_t vtype = peek_vtype(emit, 0);
    stack_info_t *top = peek_stack(emit, 0);
    int to = thumb_local_reg(emit, local_num);
    if (to >= 0 && to < ASM_THUMB_REG_R8) {
        if (top->kind == STACK_REG && top->data.u_reg == emit->thumb.made_reg && emit->thumb.made_end == code_end(emit)
            && uses_of_reg(emit, emit->thumb.made_reg) == 1 && uses_of_reg(emit, to) == 0) {
            asm_thumb_redirect(emit->as, to);
            emit->thumb.flags_reg = emit->thumb.flags_reg == emit->thumb.made_reg ? to : -1;
            adjust_stack(emit, -1);
        } else {
            emit_pre_pop_reg(emit, &vtype, to);
        }
        return vtype;
    }
    int reg = stack_reg(emit, 1);
    adjust_stack(emit, -1);
    if (to >= 0) {
        ASM_MOV_REG_REG(emit->as, to, reg);
    } else {
        emit_native_mov_state_reg(emit, thumb_local_index(emit, local_num), reg);
    }
    emit->thumb.stored_end = code_end(emit);
    emit->thumb.stored_local = local_num;
    emit->thumb.stored_reg = reg;
    return vtype;
}

// Return the binary logarithm of the size of what a pointer points to, -1 for another type.
static int pointed_size(vtype_kind_t vtype) {
    return vtype == VTYPE_PTR8 ? 0 : vtype == VTYPE_PTR16 ? 1 : vtype == VTYPE_PTR32 ? 2 : -1;
}

// base[index]; index, base on the stack. Return false, with nothing done, for types that this cannot do.
static bool thumb_load_subscr(emit_t *emit) {
    vtype_kind_t vtype_index = peek_vtype(emit, 0);
    int shift = pointed_size(peek_vtype(emit, 1));
    if (shift < 0 || (vtype_index != VTYPE_INT && vtype_index != VTYPE_UINT)) {
        return false;
    }
    mp_int_t at;
    if (is_constant(emit, 1, &at) && 0 <= at && at < 32) {
        int base = stack_reg(emit, 2);
        adjust_stack(emit, -2);
        int reg = result_reg(emit, base);
        asm_thumb_load_reg_reg_offset(emit->as, reg, base, at, shift);
        push_made(emit, VTYPE_INT, reg);
        return true;
    }
    int index = stack_reg(emit, 1);
    int base = stack_reg(emit, 2);
    if (shift) {
        int scaled = changed_reg(emit, index);
        asm_thumb_lsl_rlo_rlo_i5(emit->as, scaled, index, shift);
        index = scaled;
    }
    adjust_stack(emit, -2);
    int reg = result_reg(emit, index);
    static const uint16_t loads[] = {
        ASM_THUMB_FORMAT_7_LDR | ASM_THUMB_FORMAT_7_BYTE_TRANSFER,
        ASM_THUMB_FORMAT_8_LDRH,
        ASM_THUMB_FORMAT_7_LDR | ASM_THUMB_FORMAT_7_WORD_TRANSFER,
    };
    asm_thumb_format_7_8(emit->as, loads[shift], reg, base, index);
    push_made(emit, VTYPE_INT, reg);
    return true;
}

// base[index] = value; index, base, value on the stack. Return false as above.
static bool thumb_store_subscr(emit_t *emit) {
    vtype_kind_t vtype_index = peek_vtype(emit, 0);
    vtype_kind_t vtype_value = peek_vtype(emit, 2);
    int shift = pointed_size(peek_vtype(emit, 1));
    if (shift < 0 || (vtype_index != VTYPE_INT && vtype_index != VTYPE_UINT)
        || (vtype_value != VTYPE_BOOL && vtype_value != VTYPE_INT && vtype_value != VTYPE_UINT)) {
        return false;
    }
    mp_int_t at;
    bool constant = is_constant(emit, 1, &at) && 0 <= at && at < 32;
    int index = constant ? -1 : stack_reg(emit, 1);
    int base = stack_reg(emit, 2);
    int value = stack_reg(emit, 3);
    if (constant) {
        asm_thumb_store_reg_reg_offset(emit->as, value, base, at, shift);
    } else {
        if (shift) {
            int scaled = changed_reg(emit, index);
            asm_thumb_lsl_rlo_rlo_i5(emit->as, scaled, index, shift);
            index = scaled;
        }
        static const uint16_t stores[] = {
            ASM_THUMB_FORMAT_7_STR | ASM_THUMB_FORMAT_7_BYTE_TRANSFER,
            ASM_THUMB_FORMAT_8_STRH,
            ASM_THUMB_FORMAT_7_STR | ASM_THUMB_FORMAT_7_WORD_TRANSFER,
        };
        asm_thumb_format_7_8(emit->as, stores[shift], value, base, index);
    }
    adjust_stack(emit, -3);
    return true;
}

static void thumb_unary_op(emit_t *emit, mp_unary_op_t op) {
    vtype_kind_t vtype = peek_vtype(emit, 0);
    int from = stack_reg(emit, 1);
    adjust_stack(emit, -1);
    int reg = result_reg(emit, from);
    asm_thumb_format_4(emit->as, op == MP_UNARY_OP_NEGATIVE ? ASM_THUMB_FORMAT_4_NEG : ASM_THUMB_FORMAT_4_MVN, reg, from);
    push_made_and_flagged(emit, vtype, reg);
}

// A comparison makes a 0 or a 1. A jump that tests it at once takes that code back: see thumb_jump_if().
static void thumb_compare(emit_t *emit, mp_binary_op_t op, bool is_signed) {
    static const uint8_t conditions[6 + 6] = {
        // unsigned
        ASM_THUMB_CC_CC,
        ASM_THUMB_CC_HI,
        ASM_THUMB_CC_EQ,
        ASM_THUMB_CC_LS,
        ASM_THUMB_CC_CS,
        ASM_THUMB_CC_NE,
        // signed
        ASM_THUMB_CC_LT,
        ASM_THUMB_CC_GT,
        ASM_THUMB_CC_EQ,
        ASM_THUMB_CC_LE,
        ASM_THUMB_CC_GE,
        ASM_THUMB_CC_NE,
    };
    mp_int_t value;
    bool constant = is_constant(emit, 1, &value) && 0 <= value && value < 256;
    int rhs = constant ? -1 : stack_reg(emit, 1);
    int lhs = stack_reg(emit, 2);
    if (constant) {
        asm_thumb_cmp_rlo_i8(emit->as, lhs, value);
    } else {
        asm_thumb_cmp_rlo_rlo(emit->as, lhs, rhs);
    }
    adjust_stack(emit, -2);
    int reg = free_reg(emit);
    int cc = conditions[op - MP_BINARY_OP_LESS + (is_signed ? 6 : 0)];
    emit->thumb.compared_at = code_end(emit);
    asm_thumb_bcc_rel9(emit->as, cc, 6);
    asm_thumb_mov_rlo_i8(emit->as, reg, 0);
    asm_thumb_b_rel12(emit->as, 4);
    asm_thumb_mov_rlo_i8(emit->as, reg, 1);
    emit->thumb.compared_end = code_end(emit);
    emit->thumb.compared_cc = cc;
    emit->thumb.compared_reg = reg;
    emit_post_push_reg(emit, VTYPE_BOOL, reg);
}

// x op value, where one instruction does it. Return false, with nothing done, where none does.
static bool thumb_constant_op(emit_t *emit, mp_binary_op_t op, mp_int_t value) {
    vtype_kind_t vtype = peek_vtype(emit, 1);
    bool shifts = op == MP_BINARY_OP_LSHIFT || op == MP_BINARY_OP_RSHIFT;
    bool adds = op == MP_BINARY_OP_ADD || op == MP_BINARY_OP_SUBTRACT;
    bool extends = op == MP_BINARY_OP_AND && (value == 0xff || value == 0xffff);
    bool subtracts = op == MP_BINARY_OP_SUBTRACT;
    if (adds && value < 0) {
        value = -value;
        subtracts = !subtracts;
    }
    if (!(extends || (shifts && 0 <= value && value < 32) || (adds && value < 256))) {
        return false;
    }
    int lhs = stack_reg(emit, 2);
    adjust_stack(emit, -2);
    if (value == 0) {
        emit_post_push_reg(emit, vtype, lhs);
        return true;
    }
    int reg = result_reg(emit, lhs);
    if (extends) {
        uint extend = value == 0xff ? ASM_THUMB_FORMAT_11_UXTB : ASM_THUMB_FORMAT_11_UXTH;
        asm_thumb_format_11(emit->as, extend, reg, lhs);
        push_made(emit, vtype, reg);
    } else if (shifts) {
        uint shift = op == MP_BINARY_OP_LSHIFT ? ASM_THUMB_FORMAT_1_LSL
            : vtype == VTYPE_UINT ? ASM_THUMB_FORMAT_1_LSR : ASM_THUMB_FORMAT_1_ASR;
        asm_thumb_format_1(emit->as, shift, reg, lhs, value);
        push_made_and_flagged(emit, vtype, reg);
    } else if (value < 8) {
        uint add = subtracts ? ASM_THUMB_FORMAT_2_SUB : ASM_THUMB_FORMAT_2_ADD;
        asm_thumb_format_2(emit->as, add | ASM_THUMB_FORMAT_2_IMM_OPERAND, reg, lhs, value);
        push_made_and_flagged(emit, vtype, reg);
    } else {
        if (reg != lhs) {
            ASM_MOV_REG_REG(emit->as, reg, lhs);
        }
        asm_thumb_format_3(emit->as, subtracts ? ASM_THUMB_FORMAT_3_SUB : ASM_THUMB_FORMAT_3_ADD, reg, value);
        push_flagged(emit, vtype, reg);
    }
    return true;
}

// An operation on two numbers. Return false, with nothing done, for one that this cannot do.
static bool thumb_binary_op(emit_t *emit, mp_binary_op_t op) {
    vtype_kind_t vtype = peek_vtype(emit, 1);
    if (MP_BINARY_OP_LESS <= op && op <= MP_BINARY_OP_NOT_EQUAL) {
        if (vtype != peek_vtype(emit, 0)) {
            return false;
        }
        thumb_compare(emit, op, vtype == VTYPE_INT);
        return true;
    }
    uint alu = 0;
    bool commutes = true;
    switch (op) {
        case MP_BINARY_OP_ADD:
        case MP_BINARY_OP_SUBTRACT:
            break;
        case MP_BINARY_OP_OR:
            alu = ASM_THUMB_FORMAT_4_ORR;
            break;
        case MP_BINARY_OP_XOR:
            alu = ASM_THUMB_FORMAT_4_EOR;
            break;
        case MP_BINARY_OP_AND:
            alu = ASM_THUMB_FORMAT_4_AND;
            break;
        case MP_BINARY_OP_MULTIPLY:
            alu = ASM_THUMB_FORMAT_4_MUL;
            break;
        case MP_BINARY_OP_LSHIFT:
            alu = ASM_THUMB_FORMAT_4_LSL;
            commutes = false;
            break;
        case MP_BINARY_OP_RSHIFT:
            alu = vtype == VTYPE_UINT ? ASM_THUMB_FORMAT_4_LSR : ASM_THUMB_FORMAT_4_ASR;
            commutes = false;
            break;
        default:
            return false;
    }
    mp_int_t value;
    if (is_constant(emit, 1, &value) && thumb_constant_op(emit, op, value)) {
        return true;
    }
    if (op == MP_BINARY_OP_SUBTRACT && is_constant(emit, 2, &value) && value == 0) {
        int rhs = stack_reg(emit, 1);
        adjust_stack(emit, -2);
        int reg = result_reg(emit, rhs);
        asm_thumb_neg_rlo_rlo(emit->as, reg, rhs);
        push_made_and_flagged(emit, vtype, reg);
        return true;
    }
    int rhs = stack_reg(emit, 1);
    int lhs = stack_reg(emit, 2);
    if (alu == 0) {
        adjust_stack(emit, -2);
        int reg = result_reg(emit, lhs);
        if (reg != lhs) {
            reg = result_reg(emit, rhs);
        }
        uint add = op == MP_BINARY_OP_ADD ? ASM_THUMB_FORMAT_2_ADD : ASM_THUMB_FORMAT_2_SUB;
        asm_thumb_format_2(emit->as, add | ASM_THUMB_FORMAT_2_REG_OPERAND, reg, lhs, rhs);
        push_made_and_flagged(emit, vtype, reg);
        return true;
    }
    // the result takes the place of the first operand
    if (commutes && changed_reg(emit, lhs) != lhs && changed_reg(emit, rhs) == rhs) {
        int other = lhs;
        lhs = rhs;
        rhs = other;
    }
    int reg = changed_reg(emit, lhs);
    if (reg != lhs) {
        ASM_MOV_REG_REG(emit->as, reg, lhs);
    }
    adjust_stack(emit, -2);
    asm_thumb_format_4(emit->as, alu, reg, rhs);
    push_flagged(emit, vtype, reg);
    return true;
}

// A jump if the number on top of the stack is not zero, or is zero. Return false, with nothing done, for another type.
static bool thumb_jump_if(emit_t *emit, bool cond, mp_uint_t label) {
    vtype_kind_t vtype = peek_vtype(emit, 0);
    if (vtype != VTYPE_BOOL && vtype != VTYPE_INT && vtype != VTYPE_UINT) {
        return false;
    }
    for (int i = 0; i < emit->stack_size - 1; i++) {
        if (emit->stack_info[i].kind == STACK_IMM) {
            return false; // it has to be in memory at a jump, and to put it there changes the flags
        }
    }
    int cc = ASM_THUMB_CC_NE;
    int reg = stack_reg(emit, 1);
    size_t end = code_end(emit);
    if (end == emit->thumb.compared_end && reg == emit->thumb.compared_reg && !emit->as->base.suppress) {
        emit->as->base.code_offset = emit->thumb.compared_at;
        emit->thumb.compared_end = 0;
        cc = emit->thumb.compared_cc;
    } else if (end != emit->thumb.flags_end || reg != emit->thumb.flags_reg) {
        asm_thumb_cmp_rlo_i8(emit->as, reg, 0);
    }
    adjust_stack(emit, -1);
    need_reg_all(emit);
    asm_thumb_bcc_label(emit->as, cond ? cc : cc ^ 1, label);
    return true;
}

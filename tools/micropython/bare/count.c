// A plugin for QEMU: prints how many instructions a program has executed.
#include <inttypes.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

// QEMU's qemu-plugin.h, as far as needed here
typedef uint64_t plugin;
struct block;
size_t qemu_plugin_tb_n_insns(const struct block *block);
void qemu_plugin_register_vcpu_tb_trans_cb(plugin id, void (*translated)(plugin id, struct block *block));
void qemu_plugin_register_vcpu_tb_exec_cb(struct block *block, void (*executed)(unsigned cpu, void *what), int registers, void *what);
void qemu_plugin_register_atexit_cb(plugin id, void (*ended)(plugin id, void *what), void *what);
int qemu_plugin_version = VERSION;

static uint64_t count;

static void executed(unsigned cpu, void *instructions) {
    count += (size_t)instructions;
}

static void translated(plugin id, struct block *block) {
    qemu_plugin_register_vcpu_tb_exec_cb(block, executed, 0, (void *)qemu_plugin_tb_n_insns(block));
}

static void ended(plugin id, void *what) {
    fprintf(stderr, "\ninstructions %" PRIu64 "\n", count);
}

int qemu_plugin_install(plugin id, const void *qemu, int count, char **words) {
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, ended, NULL);
    return 0;
}

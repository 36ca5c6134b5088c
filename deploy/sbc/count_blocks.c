/* A plugin of QEMU's that counts the instructions an emulated program executes, in all its threads, while the
   program has it switched on. The program switches by a system call without effect:

       getpriority(PRIO_PROCESS, 0x7700001)   count from here
       getpriority(PRIO_PROCESS, 0x7700000)   stop, and write the file `out=FILE`

   The file has a line for each block of instructions that has run: address and number of instructions, and how
   often it ran. tests/bench/arm64.py builds and reads it.

   QEMU 7.2, which Debian 12 has, comes without the header of its plugins: what is used here is declared as its
   documentation describes it, version 1. */
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
typedef uint64_t Plugin;
typedef struct Translated Translated;
enum { NO_REGISTERS = 0 };
size_t qemu_plugin_tb_n_insns(const Translated *);
uint64_t qemu_plugin_tb_vaddr(const Translated *);
void qemu_plugin_register_vcpu_tb_trans_cb(Plugin, void (*)(Plugin, Translated *));
void qemu_plugin_register_vcpu_tb_exec_cb(Translated *, void (*)(unsigned, void *), int, void *);
void qemu_plugin_register_vcpu_syscall_cb(Plugin, void (*)(Plugin, unsigned, int64_t, uint64_t, uint64_t, uint64_t, uint64_t,
                                                            uint64_t, uint64_t, uint64_t, uint64_t));
EXPORT int qemu_plugin_version = 1;

enum { GETPRIORITY = 141, SWITCH = 0x7700000 }; /* of arm64's system calls; tests/bench/marks.py has the other */

typedef struct Block {
    struct Block *next;
    uint64_t address, size, runs; /* runs  while switched on */
} Block;

static Block *blocks; /* the newest first; none is ever removed */
static const char *path = "blocks.txt";
static bool counting;

static void executed(unsigned cpu, void *block)
{
    (void)cpu;
    if (__atomic_load_n(&counting, __ATOMIC_RELAXED)) __atomic_fetch_add(&((Block *)block)->runs, 1, __ATOMIC_RELAXED);
}

static void translated(Plugin plugin, Translated *code)
{
    (void)plugin;
    Block *block = calloc(1, sizeof *block);
    if (!block) abort();
    block->address = qemu_plugin_tb_vaddr(code);
    block->size = qemu_plugin_tb_n_insns(code);
    block->next = __atomic_load_n(&blocks, __ATOMIC_RELAXED);
    while (!__atomic_compare_exchange_n(&blocks, &block->next, block, true, __ATOMIC_RELEASE, __ATOMIC_RELAXED)) {
    } /* another thread has put one in front meanwhile */
    qemu_plugin_register_vcpu_tb_exec_cb(code, executed, NO_REGISTERS, block);
}

static void write_blocks(void)
{
    FILE *file = fopen(path, "w");
    if (!file) abort();
    for (Block *block = __atomic_load_n(&blocks, __ATOMIC_ACQUIRE); block; block = block->next)
        if (block->runs) fprintf(file, "%" PRIx64 " %" PRIu64 " %" PRIu64 "\n", block->address, block->size, block->runs);
    fclose(file);
}

static void called(Plugin plugin, unsigned cpu, int64_t number, uint64_t which, uint64_t who, uint64_t c, uint64_t d,
                   uint64_t e, uint64_t f, uint64_t g, uint64_t h)
{
    (void)plugin, (void)cpu, (void)which, (void)c, (void)d, (void)e, (void)f, (void)g, (void)h;
    if (number != GETPRIORITY || (who & ~(uint64_t)1) != SWITCH) return;
    __atomic_store_n(&counting, who & 1, __ATOMIC_RELAXED);
    if (!(who & 1)) write_blocks();
}

EXPORT int qemu_plugin_install(Plugin plugin, const void *machine, int n, char **arguments)
{
    (void)machine;
    for (int i = 0; i < n; i++)
        if (!strncmp(arguments[i], "out=", 4)) path = strdup(arguments[i] + 4); /* QEMU frees its own */
    qemu_plugin_register_vcpu_tb_trans_cb(plugin, translated);
    qemu_plugin_register_vcpu_syscall_cb(plugin, called);
    return 0;
}

// SPDX-License-Identifier: Apache-2.0
// Plugin of QEMU's user mode: prints how many instructions a program executed, and how much memory they touched, in
// pages of 4 KiB. Usage: docs/performance.md.
//
// The declarations are those parts of qemu-plugin.h, version 1, that are used here; Debian does not package that
// header. Counts of programs with several threads are approximate, because additions are not atomic.
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

struct qemu_plugin_tb;
struct qemu_plugin_insn;
enum { INLINE_ADD_U64, CB_NO_REGS = 0, MEM_RW = 3 };
extern size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb*);
extern struct qemu_plugin_insn* qemu_plugin_tb_get_insn(const struct qemu_plugin_tb*, size_t);
extern void qemu_plugin_register_vcpu_tb_trans_cb(uint64_t id, void (*)(uint64_t id, struct qemu_plugin_tb*));
extern void qemu_plugin_register_vcpu_insn_exec_inline(struct qemu_plugin_insn*, int operation, void*, uint64_t);
extern void qemu_plugin_register_vcpu_mem_cb(struct qemu_plugin_insn*,
                                             void (*)(unsigned cpu, uint32_t info, uint64_t address, void*), int flags,
                                             int accesses, void*);
extern void qemu_plugin_register_atexit_cb(uint64_t id, void (*)(uint64_t id, void*), void*);

int qemu_plugin_version = 1;

enum { PAGE_BITS = 12, LEAF_BITS = 21 };
static uint64_t instructions, pages;
static uint8_t* leaves[1 << (48 - PAGE_BITS - LEAF_BITS)]; // a byte for each page of an address space of 48 bits

static void access_memory(unsigned cpu, uint32_t info, uint64_t address, void* unused) {
  (void)cpu, (void)info, (void)unused;
  const uint64_t page = (address & ((1ULL << 48) - 1)) >> PAGE_BITS;
  uint8_t** const leaf = &leaves[page >> LEAF_BITS];
  if (!*leaf)
    *leaf = calloc(1, 1 << LEAF_BITS);
  uint8_t* const touched = &(*leaf)[page & ((1 << LEAF_BITS) - 1)];
  pages += !*touched;
  *touched = 1;
}

static void translate(uint64_t id, struct qemu_plugin_tb* block) {
  (void)id;
  for (size_t i = 0; i < qemu_plugin_tb_n_insns(block); ++i) {
    struct qemu_plugin_insn* const each = qemu_plugin_tb_get_insn(block, i);
    qemu_plugin_register_vcpu_insn_exec_inline(each, INLINE_ADD_U64, &instructions, 1);
    qemu_plugin_register_vcpu_mem_cb(each, access_memory, CB_NO_REGS, MEM_RW, NULL);
  }
}

static void print(uint64_t id, void* unused) {
  (void)id, (void)unused;
  fprintf(stderr, "%.3f million instructions, %.1f MB touched\n", 1e-6 * (double)instructions,
          1e-6 * (double)(pages << PAGE_BITS));
}

int qemu_plugin_install(uint64_t id, const void* host, int argc, char** argv) {
  (void)host, (void)argc, (void)argv;
  qemu_plugin_register_vcpu_tb_trans_cb(id, translate);
  qemu_plugin_register_atexit_cb(id, print, NULL);
  return 0;
}

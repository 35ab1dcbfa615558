// SPDX-License-Identifier: Apache-2.0
// The page as bytes of the program: in C++ it would be a literal longer than compilers must take.
        .section .rodata
        .global locus_experiments_page_begin
        .global locus_experiments_page_end
locus_experiments_page_begin:
        .incbin LOCUS_EXPERIMENTS_PAGE
locus_experiments_page_end:
        .byte 0
        .section .note.GNU-stack, "", %progbits

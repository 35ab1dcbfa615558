// SPDX-License-Identifier: Apache-2.0
// A page as bytes of the program: in C++ it would be a literal longer than compilers must take.
        .section .rodata
        .global LOCUS_PAGE_BEGIN
        .global LOCUS_PAGE_END
LOCUS_PAGE_BEGIN:
        .incbin LOCUS_PAGE
LOCUS_PAGE_END:
        .byte 0
        .section .note.GNU-stack, "", %progbits

// SPDX-License-Identifier: Apache-2.0
// Embeds a page as bytes: a C++ literal would exceed the length that compilers must support.
        .section .rodata
        .global LOCUS_PAGE_BEGIN
        .global LOCUS_PAGE_END
LOCUS_PAGE_BEGIN:
        .incbin LOCUS_PAGE
LOCUS_PAGE_END:
        .byte 0
        .section .note.GNU-stack, "", %progbits

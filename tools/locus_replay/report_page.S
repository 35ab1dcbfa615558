// SPDX-License-Identifier: Apache-2.0
// The page of the report as bytes of the program: in C++ it would be a literal longer than compilers must take.
        .section .rodata
        .global locus_report_page_begin
        .global locus_report_page_end
locus_report_page_begin:
        .incbin LOCUS_REPORT_PAGE
locus_report_page_end:
        .byte 0
        .section .note.GNU-stack, "", %progbits

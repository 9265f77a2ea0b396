/* SPDX-License-Identifier: MIT */
/* Text as roff. */
#include <string.h>

#include "drivers/host/scanhead.h"
#include "firmware_sim/app/help/help.h"

void roff_put(const char *text, size_t n)
{
    static const char marks[] = "\\-'`^~"; /* roff takes these for something else than themselves */
    static const char *const instead[] = {"\\e", "\\-", "\\(aq", "\\(ga", "\\(ha", "\\(ti"};
    if (n > 0 && text[0] == '.') fputs("\\&", stdout); /* else roff takes the line for a request */
    for (size_t i = 0; i < n; i++) {
        const char *mark = strchr(marks, text[i]);
        if (mark != NULL)
            fputs(instead[mark - marks], stdout);
        else
            putchar(text[i]);
    }
}

void roff_text(const char *text)
{
    roff_put(text, strlen(text));
    putchar('\n');
}

/* Length of the first line, with its '\n'. */
static size_t line_len(const char *text)
{
    const size_t n = strcspn(text, "\n");
    return n + (text[n] == '\n');
}

static void put_lines(const char *text, size_t n)
{
    for (size_t len; n > 0; text += len, n -= len) {
        len = line_len(text);
        roff_put(text, len);
    }
}

/* A block of lines is a paragraph where no line is indented, and none has columns. */
static int is_paragraph(const char *text, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (text[i] == ' ' && (i == 0 || text[i - 1] == '\n' || text[i - 1] == ' ')) return 0;
    return 1;
}

void roff_notes(const char *notes)
{
    while (*notes != '\0') {
        size_t n = 0;
        while (notes[n] != '\0' && notes[n] != '\n')
            n += line_len(notes + n);
        const int is_filled = is_paragraph(notes, n);
        puts(is_filled ? ".PP" : ".PP\n.nf");
        put_lines(notes, n);
        if (!is_filled) puts(".fi");
        notes += n + (notes[n] == '\n');
    }
}

void roff_head(const char *name, const char *section, const char *summary)
{
    fputs(".TH ", stdout);
    for (const char *c = name; *c != '\0'; c++)
        roff_put(*c >= 'a' && *c <= 'z' ? (char[]){(char)(*c - 'a' + 'A')} : c, 1);
    printf(" %s \"\" \"scanhead %s\"\n.SH NAME\n", section, scanhead_version());
    roff_put(name, strlen(name));
    fputs(" \\- ", stdout);
    roff_text(summary);
}

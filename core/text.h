/* SPDX-License-Identifier: MIT */
/* A file in memory, and reading text from it: words, numbers, lines. In: a path. Out: its bytes, and a place
 * in them that each call moves on. Numbers are exact (nearest double) and don't depend on the locale. */
#ifndef CORE_TEXT_H
#define CORE_TEXT_H

#include <locale.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <strings.h>

#include "core/err.h"

/* Part of a text; the bytes stay where they are, without a NUL. */
struct text_span {
    const char *p;
    size_t n;
};

static inline struct text_span text_span_of(const char *text)
{
    return (struct text_span){text, strlen(text)};
}

/* The same text? */
bool text_is(struct text_span span, const char *text);
/* The same word, whatever its case? */
bool text_is_word(struct text_span span, const char *word);

/* Whether a file's name ends so, whatever its case; the ending alone is not such a name. */
static inline bool text_has_ending(const char *file, const char *ending)
{
    const size_t len = strlen(file), n = strlen(ending);
    return len > n && strcasecmp(file + len - n, ending) == 0;
}

/* Whether the list has the text. NULL ends the list. */
bool text_is_one_of(struct text_span span, const char *const *list);

struct text {
    const char *path; /* the caller's */
    char *data;       /* the whole file, with a NUL after it */
    size_t size;
    const char *p, *end;
    uint64_t line;  /* of p, from 1 */
    bool continued; /* a backslash before the line's end joins the next one (OBJ) */
    locale_t c_locale;
    size_t n_dropped; /* bytes from data on that text_drop_read has given back */
};

/* Called after every 16 MiB that are read, with fraction -1 (unknown). Where it returns other than 0, with err filled,
 * reading ends. */
typedef int text_progress(void *ctx, double fraction, struct sh_err *err);

/* Reads the whole file; p is at its first byte, or after UTF-8's byte order mark. progress may be NULL. text_close is
 * due in any case. */
int text_open(struct text *t, const char *path, text_progress *progress, void *ctx, struct sh_err *err);
void text_close(struct text *t);

/* Gives memory before p back to the system. Nothing there may be read again. */
void text_drop_read(struct text *t);

/* Fails with "FILE, line N: text", or without the line when it is 0. Returns code. */
int text_fail(const struct text *t, uint64_t line, int code, struct sh_err *err, const char *fmt, ...)
    __attribute__((format(printf, 5, 6)));

/* 0 to 15; -1: it is no hexadecimal digit. */
static inline int text_hex_digit(char c)
{
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}

/* Skips blanks, and line ends that a backslash hides. */
void text_skip_blanks(struct text *t);

/* Does a word end at p? */
bool text_at_word_end(const struct text *t);

/* At the end of the line (LF, CR LF or CR), or of the file? */
bool text_at_line_end(const struct text *t);

/* Moves past the end of this line, whatever is still on it. */
void text_next_line(struct text *t);

/* The next run of characters that are not blank; empty at the line's end. */
struct text_span text_word(struct text *t);

/* The rest of the line, without blanks at either end. */
struct text_span text_rest(struct text *t);

/* A number that fills the word at p; false and p unmoved when it isn't one. NaN and inf are numbers here. */
bool text_number(struct text *t, double *value);

/* Reads up to 18 decimal digits, with or without a sign. p is then at the byte after them, whatever that is. */
bool text_integer(struct text *t, int64_t *value);

#endif

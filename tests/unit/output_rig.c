/* SPDX-License-Identifier: MIT */
#include "tests/unit/output_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

void output_take(struct output *output, FILE *stream)
{
    output->stream = stream;
    strcpy(output->path, "/tmp/scanhead-output-XXXXXX");
    const int fd = mkstemp(output->path);
    assert_true(fd >= 0);
    fflush(stream);
    output->was = dup(fileno(stream));
    assert_true(output->was >= 0 && dup2(fd, fileno(stream)) >= 0);
    close(fd);
}

char *output_give(struct output *output)
{
    enum { MOST = 131072 };
    char *text = calloc(1, MOST);
    fflush(output->stream);
    assert_true(dup2(output->was, fileno(output->stream)) >= 0);
    close(output->was);
    FILE *f = fopen(output->path, "r");
    assert_true(f != NULL && text != NULL);
    assert_true(fread(text, 1, MOST, f) < MOST);
    fclose(f);
    unlink(output->path);
    return text;
}

static int is_progress(const char *line, size_t len)
{
    if (len >= 5 && memcmp(line + len - 5, " ...\n", 5) == 0) return 1;
    for (size_t i = 2; i < len; i++)
        if (line[i] == '%' && line[i - 1] == ' ' && line[i - 2] >= '0' && line[i - 2] <= '9') return 1;
    return 0;
}

char *output_give_said(struct output *output)
{
    char *text = output_give(output), *to = text;
    for (const char *line = text, *next; *line != '\0'; line = next) {
        next = strchrnul(line, '\n');
        next += *next == '\n';
        const size_t len = (size_t)(next - line);
        if (is_progress(line, len)) continue;
        memmove(to, line, len);
        to += len;
    }
    *to = '\0';
    return text;
}

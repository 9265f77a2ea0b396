/* SPDX-License-Identifier: MIT */
#include "core/import/geotiff/tags.h"

#include <string.h>

#include "core/infile.h"

enum { SHORT = 3, LONG = 4, DOUBLE = 12, LONG8 = 16, ASCII = 2 };
enum { MOST_ENTRIES = 65535 };

/* An entry: where its values are. */
struct entry {
    unsigned type;
    uint64_t n, at;
};

static uint64_t tags_load(const struct tags *t, const uint8_t *p, size_t size)
{
    uint64_t value = 0;
    for (size_t i = 0; i < size; i++)
        value = value << 8 | p[t->is_big_endian ? i : size - 1 - i];
    return value;
}

static int tags_take(const struct tags *t, uint64_t at, void *out, size_t size, struct sh_err *err)
{
    if (at <= INT64_MAX && fseeko(t->file, (off_t)at, SEEK_SET) == 0 && fread(out, 1, size, t->file) == size)
        return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: cut off: its data continue at byte %llu", t->path, (unsigned long long)at);
}

/* The head: byte order, 42 or 43, and where the directory is. */
static int read_head(struct tags *t, struct sh_err *err)
{
    uint8_t head[16], count[8];
    uint64_t at;
    int rc = tags_take(t, 0, head, 8, err);
    if (rc != SH_OK) return sh_fail(err, rc, "%s: not a TIFF: it has less than 8 bytes", t->path);
    t->is_big_endian = head[0] == 'M';
    const uint64_t version = tags_load(t, head + 2, 2);
    if (head[0] != head[1] || (head[0] != 'I' && head[0] != 'M') || (version != 42 && version != 43))
        return sh_fail(err, SH_EINPUT, "%s: not a TIFF: its first bytes must be \"II\" or \"MM\" and 42 or 43",
                       t->path);
    t->is_big = version == 43;
    if (t->is_big) rc = tags_take(t, 0, head, 16, err);
    if (rc != SH_OK) return rc;
    at = t->is_big ? tags_load(t, head + 8, 8) : tags_load(t, head + 4, 4);
    const size_t size = t->is_big ? 8 : 2;
    rc = tags_take(t, at, count, size, err);
    if (rc != SH_OK) return rc;
    t->n = tags_load(t, count, size);
    t->first = at + size;
    if (t->n <= MOST_ENTRIES) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: %llu tags in its directory; allowed are %d", t->path, (unsigned long long)t->n,
                   MOST_ENTRIES);
}

int tags_open(struct tags *tags, const char *path, struct sh_err *err)
{
    const char *why;
    *tags = (struct tags){.path = path, .file = infile_open(path, &why)};
    if (tags->file == NULL) return sh_fail(err, SH_EINPUT, "%s: %s", path, why);
    return read_head(tags, err);
}

void tags_close(struct tags *tags)
{
    if (tags->file != NULL) fclose(tags->file);
    tags->file = NULL;
}

static size_t size_of(unsigned type)
{
    static const uint8_t size[] = {[ASCII] = 1, [SHORT] = 2, [LONG] = 4, [DOUBLE] = 8, [LONG8] = 8};
    return type < sizeof size ? size[type] : 0;
}

/* *found has no values where there is no such tag. Values that fit stand in the entry itself. */
static int tags_find(const struct tags *t, unsigned tag, struct entry *found, struct sh_err *err)
{
    const size_t field = t->is_big ? 8 : 4, size = 4 + 2 * field;
    *found = (struct entry){0};
    for (uint64_t i = 0; i < t->n; i++) {
        const uint64_t at = t->first + i * size;
        uint8_t p[20];
        int rc = tags_take(t, at, p, size, err);
        if (rc != SH_OK) return rc;
        if (tags_load(t, p, 2) != tag) continue;
        const unsigned type = (unsigned)tags_load(t, p + 2, 2);
        if (size_of(type) == 0)
            return sh_fail(err, SH_EINPUT,
                           "%s: its tag %u has values of type %u; allowed are the TIFF types 2, 3, 4, 12 and 16",
                           t->path, tag, type);
        const uint64_t n = tags_load(t, p + 4, field);
        *found =
            (struct entry){type, n, n <= field / size_of(type) ? at + 4 + field : tags_load(t, p + 4 + field, field)};
        return SH_OK;
    }
    return SH_OK;
}

static double number(const struct tags *t, unsigned type, const uint8_t *p)
{
    const uint64_t bits = tags_load(t, p, size_of(type));
    double value;
    if (type != DOUBLE) return (double)bits;
    memcpy(&value, &bits, sizeof value);
    return value;
}

int tags_numbers(const struct tags *tags, unsigned tag, double *out, size_t most, size_t *n, struct sh_err *err)
{
    struct entry found;
    int rc = tags_find(tags, tag, &found, err);
    *n = rc == SH_OK && found.n < most ? (size_t)found.n : rc == SH_OK ? most : 0;
    for (size_t i = 0; i < *n && rc == SH_OK; i++) {
        uint8_t p[8];
        rc = tags_take(tags, found.at + i * size_of(found.type), p, size_of(found.type), err);
        if (rc == SH_OK) out[i] = number(tags, found.type, p);
    }
    return rc;
}

int tags_text(const struct tags *tags, unsigned tag, char *out, size_t room, struct sh_err *err)
{
    struct entry found;
    int rc = tags_find(tags, tag, &found, err);
    if (rc == SH_OK && found.type == ASCII && found.n >= room)
        rc = sh_fail(err, SH_EINPUT, "%s: its tag %u has %llu bytes; allowed are up to %zu", tags->path, tag,
                     (unsigned long long)found.n, room - 1);
    const size_t n = rc != SH_OK || found.type != ASCII ? 0 : (size_t)found.n;
    if (n > 0) rc = tags_take(tags, found.at, out, n, err);
    out[n] = '\0';
    return rc;
}

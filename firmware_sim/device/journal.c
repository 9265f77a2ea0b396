#include "firmware_sim/device/journal.h"

#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/grow.h"
#include "core/newfile.h"

static const char title[] = "# scanhead journal 1";
static const char end_line[] = "END"; /* no command has this name */

struct journal {
    FILE *file;
    const char *path; /* the caller's */
    int error;        /* errno of the first failure */
};

/* Prints text and flushes it; fails once something went wrong. */
__attribute__((format(printf, 2, 3))) static int put(struct journal *journal, const char *fmt, ...)
{
    va_list ap;
    if (journal->error != 0) return SH_EIO;
    va_start(ap, fmt);
    if (vfprintf(journal->file, fmt, ap) < 0 || fflush(journal->file) != 0) journal->error = errno;
    va_end(ap);
    return journal->error == 0 ? SH_OK : SH_EIO;
}

struct journal *journal_open(const char *path, struct sh_err *err)
{
    struct journal *journal = calloc(1, sizeof *journal);
    if (journal == NULL) {
        sh_fail(err, SH_ENOMEM, "journal: no memory");
        return NULL;
    }
    struct sh_err why = {0};
    int fd, rc = newfile_open(path, &fd, &why);
    if (rc != SH_OK) {
        sh_fail(err, rc, "journal: %s", why.text);
        free(journal);
        return NULL;
    }
    *journal = (struct journal){.path = path, .file = fdopen(fd, "w")};
    if (journal->file == NULL) {
        journal->error = errno;
        close(fd);
    }
    if (put(journal, "%s\n", title) == SH_OK) return journal;
    journal_close(journal, err);
    return NULL;
}

static int is_command_line(const char *line)
{
    const size_t len = strlen(line);
    if (len == 0 || len > COMMAND_MAX_LINE) return 0;
    for (const char *p = line; *p != '\0'; p++)
        if (*p < 0x20 || *p > 0x7e) return 0;
    return 1;
}

int journal_write(struct journal *journal, uint64_t tick, int64_t t_ns, uint32_t session, const char *line)
{
    if (t_ns < 0 || !is_command_line(line)) return SH_EINPUT;
    return put(journal, "%" PRIu64 " %" PRId64 " %" PRIu32 " %s\n", tick, t_ns, session, line);
}

int journal_end(struct journal *journal, uint64_t tick, int64_t t_ns)
{
    return journal_write(journal, tick, t_ns, 0, end_line);
}

int journal_is_end(const struct journal_entry *entry)
{
    return entry->session == 0 && strcmp(entry->line, end_line) == 0;
}

int journal_note(struct journal *journal, const char *text)
{
    if (!is_command_line(text)) return SH_EINPUT;
    return put(journal, "# %s\n", text);
}

int journal_close(struct journal *journal, struct sh_err *err)
{
    if (journal == NULL) return SH_OK;
    int error = journal->error;
    if (journal->file != NULL && fclose(journal->file) != 0 && error == 0) error = errno;
    const int rc = error == 0 ? SH_OK : sh_fail(err, SH_EIO, "journal: %s: %s", journal->path, strerror(error));
    free(journal);
    return rc;
}

/* A decimal number up to max and the blank after it. Digits only: strtoull would take signs and blanks. */
static int take_number(const char **p, uint64_t max, uint64_t *value)
{
    const char *q = *p;
    *value = 0;
    for (; *q >= '0' && *q <= '9'; q++) {
        const uint64_t digit = (uint64_t)(*q - '0');
        if (*value > (max - digit) / 10) return -1;
        *value = *value * 10 + digit;
    }
    if (q == *p || *q != ' ') return -1;
    *p = q + 1;
    return 0;
}

/* NULL, or what is wrong with the line. */
static const char *parse_entry(const char *text, struct journal_entry *entry)
{
    uint64_t t_ns, session;
    memset(entry, 0, sizeof *entry);
    if (take_number(&text, UINT64_MAX, &entry->tick) != 0) return "no tick number and blank";
    if (take_number(&text, INT64_MAX, &t_ns) != 0) return "no device time in ns and blank";
    if (take_number(&text, UINT32_MAX, &session) != 0) return "no session number and blank";
    if (!is_command_line(text)) return "no command of 1 to 256 printable characters";
    entry->t_ns = (int64_t)t_ns;
    entry->session = (uint32_t)session;
    memcpy(entry->line, text, strlen(text));
    return NULL;
}

struct reader {
    const char *path;
    FILE *file;
    char *text;
    size_t text_size, line_no;
    struct journal_entry *entry;
    size_t n, capacity;
};

/* 1: a line without its end is in text; 0: end of file; or a failure. */
static int read_line(struct reader *reader, struct sh_err *err)
{
    errno = 0;
    const ssize_t len = getline(&reader->text, &reader->text_size, reader->file);
    if (len < 0 && feof(reader->file)) return 0;
    if (len < 0) return sh_fail(err, SH_EIO, "journal: %s: %s", reader->path, strerror(errno));
    reader->line_no++;
    if (reader->text[len - 1] != '\n')
        return sh_fail(err, SH_EINPUT, "journal: %s:%zu: the last line is cut; end it or take it out", reader->path,
                       reader->line_no);
    reader->text[len - 1] = '\0';
    if (strlen(reader->text) != (size_t)len - 1)
        return sh_fail(err, SH_EINPUT, "journal: %s:%zu: a NUL byte", reader->path, reader->line_no);
    return 1;
}

static int add_entry(struct reader *reader, struct sh_err *err)
{
    if (!grow(&reader->entry, &reader->capacity, reader->n + 1, sizeof *reader->entry))
        return sh_fail(err, SH_ENOMEM, "journal: %s: no memory", reader->path);
    const char *wrong = parse_entry(reader->text, &reader->entry[reader->n]);
    if (wrong != NULL)
        return sh_fail(err, SH_EINPUT, "journal: %s:%zu: %s; a line is <tick> <ns> <session> <command>", reader->path,
                       reader->line_no, wrong);
    reader->n++;
    return SH_OK;
}

static int read_all(struct reader *reader, struct sh_err *err)
{
    int rc = read_line(reader, err);
    if (rc < 0) return rc;
    if (rc == 0 || strcmp(reader->text, title) != 0)
        return sh_fail(err, SH_EINPUT, "journal: %s:1: not a journal; the first line must be '%s'", reader->path,
                       title);
    while (rc >= 0 && (rc = read_line(reader, err)) > 0)
        if (reader->text[0] != '#' && reader->text[0] != '\0') rc = add_entry(reader, err);
    return rc;
}

/* Stable: equal ticks move past nothing. Journals are in order but for a few lines, where this is linear. */
static void sort_by_tick(struct journal_entry *entry, size_t n)
{
    for (size_t i = 1; i < n; i++) {
        size_t at = i;
        while (at > 0 && entry[at - 1].tick > entry[i].tick)
            at--;
        if (at == i) continue;
        const struct journal_entry moved = entry[i];
        memmove(&entry[at + 1], &entry[at], (i - at) * sizeof *entry);
        entry[at] = moved;
    }
}

int journal_read(const char *path, struct journal_entry **entries, size_t *n, struct sh_err *err)
{
    struct reader reader = {.path = path, .file = fopen(path, "re")};
    *entries = NULL;
    *n = 0;
    if (reader.file == NULL) return sh_fail(err, SH_EINPUT, "journal: %s: %s", path, strerror(errno));
    const int rc = read_all(&reader, err);
    fclose(reader.file);
    free(reader.text);
    if (rc != SH_OK) {
        free(reader.entry);
        return rc;
    }
    sort_by_tick(reader.entry, reader.n);
    *entries = reader.entry;
    *n = reader.n;
    return SH_OK;
}

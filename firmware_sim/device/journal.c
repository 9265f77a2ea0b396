#include "firmware_sim/device/journal.h"

#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/grow.h"
#include "core/infile.h"
#include "core/newfile.h"

static const char title[] = "# scanhead journal 1";
static const char end_line[] = "END"; /* no command has this name */

struct journal {
    FILE *file;
    const char *path; /* the caller's */
    _Atomic int error; /* errno of the first failure; notes come from several threads */
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

/* Longer than any line that is written, and notes of people; and more commands than fit into a day at one
 * each 10 ms. What is beyond is no journal, and would take the memory. */
enum { LINE_MAX_LEN = 1023, MAX_ENTRIES = 10000000 };

struct reader {
    const char *path;
    FILE *file;
    char text[LINE_MAX_LEN + 1];
    size_t line_no;
    struct journal_entry *entry;
    size_t n, capacity;
};

__attribute__((format(printf, 3, 4))) static int fail_line(const struct reader *reader, struct sh_err *err,
                                                           const char *fmt, ...)
{
    char what[160];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(what, sizeof what, fmt, ap);
    va_end(ap);
    return sh_fail(err, SH_EINPUT, "journal: %s:%zu: %s", reader->path, reader->line_no, what);
}

/* 1: a line without its end is in text; 0: end of file; or a failure. */
static int read_line(struct reader *reader, struct sh_err *err)
{
    size_t n = 0;
    int c;
    errno = 0;
    while ((c = getc(reader->file)) != EOF) {
        if (n == 0) reader->line_no++;
        if (c == '\n') {
            reader->text[n] = '\0';
            return 1;
        }
        if (c == '\0') return fail_line(reader, err, "a NUL byte; a journal is a text");
        if (n == LINE_MAX_LEN) return fail_line(reader, err, "too long; allowed up to %d bytes a line", LINE_MAX_LEN);
        reader->text[n++] = (char)c;
    }
    if (ferror(reader->file)) return sh_fail(err, SH_EIO, "journal: %s: %s", reader->path, strerror(errno));
    return n == 0 ? 0 : fail_line(reader, err, "the last line is cut; end it or take it out");
}

static int add_entry(struct reader *reader, struct sh_err *err)
{
    if (reader->n == MAX_ENTRIES)
        return fail_line(reader, err, "too many commands; allowed up to %d in a journal", MAX_ENTRIES);
    if (!grow(&reader->entry, &reader->capacity, reader->n + 1, sizeof *reader->entry))
        return sh_fail(err, SH_ENOMEM, "journal: %s: no memory", reader->path);
    const char *wrong = parse_entry(reader->text, &reader->entry[reader->n]);
    if (wrong != NULL) return fail_line(reader, err, "%s; a line is <tick> <ns> <session> <command>", wrong);
    reader->entry[reader->n++].line_no = (uint32_t)reader->line_no;
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

/* By tick; commands of one tick as they stand in the file. */
static int compare(const void *a, const void *b)
{
    const struct journal_entry *one = a, *other = b;
    if (one->tick != other->tick) return one->tick < other->tick ? -1 : 1;
    return one->line_no < other->line_no ? -1 : one->line_no > other->line_no;
}

int journal_check_paths(const char *path, const char *replay, struct sh_err *err)
{
    struct stat out, in;
    if (path == NULL || replay == NULL || stat(path, &out) != 0 || stat(replay, &in) != 0) return SH_OK;
    if (out.st_dev != in.st_dev || out.st_ino != in.st_ino) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "--journal %s: is the journal to replay, which it would overwrite; allowed another file", path);
}

int journal_read(const char *path, struct journal_entry **entries, size_t *n, struct sh_err *err)
{
    const char *why;
    struct reader reader = {.path = path, .file = infile_open(path, &why)};
    *entries = NULL;
    *n = 0;
    if (reader.file == NULL) return sh_fail(err, SH_EINPUT, "journal: %s: %s; a journal is a file", path, why);
    const int rc = read_all(&reader, err);
    fclose(reader.file);
    if (rc != SH_OK) {
        free(reader.entry);
        return rc;
    }
    if (reader.n > 1) qsort(reader.entry, reader.n, sizeof *reader.entry, compare);
    *entries = reader.entry;
    *n = reader.n;
    return SH_OK;
}

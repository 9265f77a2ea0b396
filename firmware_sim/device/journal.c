/* SPDX-License-Identifier: MIT */
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
#include "firmware_sim/base/line_writer.h"
#include "firmware_sim/device/pose_line.h"

static const char title[] = "# scanhead journal 1\n";
static const char end_line[] = "END";    /* no command has this name */
static const char pose_line[] = "POSE "; /* nor this one */
static const char lost_line[] = "LOST ";

enum { QUEUE_BYTES = 1 << 20, LINE_ROOM = COMMAND_MAX_LINE + 64, TITLE_LEN = sizeof title - 2 };

struct journal {
    struct line_writer *lines;
    char last[LINE_ROOM]; /* the end of the run; empty: none is known */
};

/* A missing remark does no harm to a replay. A missing command does, so readers refuse the line that stands for it. */
static void say_gap(char text[LINE_GAP_BYTES], const uint64_t lost[LINE_KINDS])
{
    int n = 0;
    if (lost[LINE_REMARK] != 0)
        n = snprintf(text, LINE_GAP_BYTES, "# missing here: %" PRIu64 " remarks\n", lost[LINE_REMARK]);
    if (lost[LINE_PLAIN] != 0)
        snprintf(text + n, LINE_GAP_BYTES - (size_t)n, "%s%" PRIu64 "\n", lost_line, lost[LINE_PLAIN]);
}

/* The first line shows whether the file can be written at all, before anything runs. */
struct journal *journal_open(const char *path, _Atomic uint64_t *lost, struct sh_err *err)
{
    struct sh_err why = {0};
    int fd, rc = newfile_open(path, &fd, &why);
    if (rc != SH_OK) {
        sh_fail(err, rc, "journal: %s", why.text);
        return NULL;
    }
    const int error = dprintf(fd, "%s", title) < 0 ? errno : 0;
    struct journal *journal = error == 0 ? calloc(1, sizeof *journal) : NULL;
    if (journal == NULL) {
        close(fd);
        sh_fail(err, error != 0 ? SH_EIO : SH_ENOMEM, "journal: %s: %s", path,
                error != 0 ? strerror(error) : "no memory");
        return NULL;
    }
    const struct line_writer_spec spec = {
        .fd = fd, .what = "journal", .path = path, .room = QUEUE_BYTES, .lost = lost, .gap = say_gap};
    if (line_writer_open(&spec, &journal->lines, err) == SH_OK) return journal;
    free(journal);
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

/* Writes a line with its '\n' into a buffer of LINE_ROOM bytes. Returns its length. */
static size_t compose(char *text, uint64_t tick, int64_t t_ns, uint32_t session, const char *line)
{
    return (size_t)snprintf(text, LINE_ROOM, "%" PRIu64 " %" PRId64 " %" PRIu32 " %s\n", tick, t_ns, session, line);
}

int journal_write(struct journal *journal, uint64_t tick, int64_t t_ns, uint32_t session, const char *line)
{
    char text[LINE_ROOM];
    if (t_ns < 0 || !is_command_line(line)) return SH_EINPUT;
    return line_writer_put(journal->lines, LINE_PLAIN, text, compose(text, tick, t_ns, session, line));
}

int journal_end(struct journal *journal, uint64_t tick, int64_t t_ns)
{
    if (t_ns < 0) return SH_EINPUT;
    compose(journal->last, tick, t_ns, 0, end_line);
    return SH_OK;
}

int journal_is_end(const struct journal_entry *entry)
{
    return entry->session == 0 && strcmp(entry->line, end_line) == 0;
}

int journal_write_pose(struct journal *journal, uint64_t tick, int64_t t_ns, const double v[6])
{
    char line[sizeof pose_line + POSE_LINE_LEN];
    memcpy(line, pose_line, sizeof pose_line);
    pose_line_write(v, line + sizeof pose_line - 1);
    return journal_write(journal, tick, t_ns, 0, line);
}

const char *journal_pose(const struct journal_entry *entry)
{
    const size_t len = sizeof pose_line - 1;
    return entry->session == 0 && strncmp(entry->line, pose_line, len) == 0 ? entry->line + len : NULL;
}

int journal_note(struct journal *journal, const char *note)
{
    char text[LINE_ROOM];
    if (!is_command_line(note)) return SH_EINPUT;
    return line_writer_put(journal->lines, LINE_REMARK, text, (size_t)snprintf(text, sizeof text, "# %s\n", note));
}

int journal_is_filling(const struct journal *journal)
{
    return journal != NULL && line_writer_is_filling(journal->lines);
}

int journal_close(struct journal *journal, struct sh_err *err)
{
    if (journal == NULL) return SH_OK;
    const int rc = line_writer_close(journal->lines, journal->last, err);
    free(journal);
    return rc;
}

/* Takes a decimal number up to max and the blank after it. Only digits are taken: strtoull would take signs, too. */
static int journal_take_number(const char **p, uint64_t max, uint64_t *value)
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

/* Returns NULL, or why the line is wrong. */
static const char *parse_entry(const char *text, struct journal_entry *entry)
{
    uint64_t t_ns, session;
    memset(entry, 0, sizeof *entry);
    if (journal_take_number(&text, UINT64_MAX, &entry->tick) != 0) return "there must be a tick number and a blank";
    if (journal_take_number(&text, INT64_MAX, &t_ns) != 0) return "there must be a device time in ns and a blank";
    if (journal_take_number(&text, UINT32_MAX, &session) != 0) return "there must be a session number and a blank";
    if (!is_command_line(text)) return "there must be a command of 1 to 256 printable characters";
    entry->t_ns = (int64_t)t_ns;
    entry->session = (uint32_t)session;
    memcpy(entry->line, text, strlen(text));
    return NULL;
}

/* Lines are shorter, also those that people write. A command each 10 ms makes 8.6 million a day, and a live platform's
 * poses at 1 kHz make 10 million in 2.8 hours. A larger file would only take memory. */
enum { LINE_MAX_LEN = 1023, MAX_ENTRIES = 10000000 };

struct reader {
    const char *path;
    FILE *file;
    char text[LINE_MAX_LEN + 1];
    size_t line_no;
    struct journal_entry *entry;
    size_t n, capacity;
    size_t end_no; /* the line that has END; 0: none so far */
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

/* 1: text has a line, without its line end; 0: end of file; or a failure. */
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
    return n == 0 ? 0 : fail_line(reader, err, "the last line is cut off; complete it or remove it");
}

static int add_entry(struct reader *reader, struct sh_err *err)
{
    if (strncmp(reader->text, lost_line, sizeof lost_line - 1) == 0)
        return fail_line(
            reader, err,
            "%.20s commands are missing here, which could not be written in time; only a complete journal can be "
            "replayed",
            reader->text + sizeof lost_line - 1);
    if (reader->end_no != 0)
        return fail_line(reader, err,
                         "stands after END of line %zu; a journal ends with END: move this line before it, or take END "
                         "out",
                         reader->end_no);
    if (reader->n == MAX_ENTRIES)
        return fail_line(reader, err, "too many commands and poses; allowed up to %d in a journal", MAX_ENTRIES);
    if (!grow(&reader->entry, &reader->capacity, reader->n + 1, sizeof *reader->entry))
        return sh_fail(err, SH_ENOMEM, "journal: %s: no memory", reader->path);
    const char *wrong = parse_entry(reader->text, &reader->entry[reader->n]);
    if (wrong != NULL) return fail_line(reader, err, "%s; a line is <tick> <ns> <session> <command>", wrong);
    if (journal_is_end(&reader->entry[reader->n])) reader->end_no = reader->line_no;
    reader->entry[reader->n++].line_no = (uint32_t)reader->line_no;
    return SH_OK;
}

static int read_all(struct reader *reader, struct sh_err *err)
{
    int rc = read_line(reader, err);
    if (rc < 0) return rc;
    if (rc == 0 || strlen(reader->text) != TITLE_LEN || memcmp(reader->text, title, TITLE_LEN) != 0)
        return sh_fail(err, SH_EINPUT, "journal: %s:1: not a journal; the first line must be '%.*s'", reader->path,
                       TITLE_LEN, title);
    while (rc >= 0 && (rc = read_line(reader, err)) > 0)
        if (reader->text[0] != '#' && reader->text[0] != '\0') rc = add_entry(reader, err);
    return rc;
}

/* Orders by tick; commands of one tick stay in the file's order. */
static int journal_compare(const void *a, const void *b)
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
                   "--journal %s: is the journal to replay, and would be overwritten; allowed is another file", path);
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
    if (reader.n > 1) qsort(reader.entry, reader.n, sizeof *reader.entry, journal_compare);
    *entries = reader.entry;
    *n = reader.n;
    return SH_OK;
}

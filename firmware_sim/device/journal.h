/* SPDX-License-Identifier: MIT */
/* The journal: every command that had an effect, and every pose that a live platform took, with their device times.
 * Replayed, it reproduces the session.
 *
 * In: commands as the device carries them out, and poses as it takes them. Out: a text file, which can be read back.
 * The file begins with the line `# scanhead journal 1`. Then there is one line per command
 *   <device tick> <device time, ns> <session> <command line>
 * with decimal numbers and one blank between them. The command takes effect with that tick. The device time is that of
 * the last released tick, which the client has seen. It is after the tick's own time where the head gave up ticks that
 * were not claimed yet.
 *   <device tick> <device time, ns> 0 POSE x y z roll pitch heading
 * is a pose of a live platform (pose_line.h). It is there from that tick on, and the device time is the pose's own. The
 * last line has the session 0 and END in place of a command: the run ended at that tick. This last line is missing
 * where the head was killed. Other lines that begin with '#' and empty lines are notes.
 *
 * A thread writes the lines at once (line_writer.h), so the caller never waits for the file. Where the file is too
 * slow, commands are dropped: a line `LOST <n>` stands for n of them, and journal_read refuses such a file. For dropped
 * notes there is only a note, since no replay needs them. */
#ifndef FIRMWARE_SIM_DEVICE_JOURNAL_H
#define FIRMWARE_SIM_DEVICE_JOURNAL_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "firmware_sim/command/command.h"

struct journal;

/* Begins a new file; path must outlive the journal. *lost counts the lines that are not in it; it may be NULL. Returns
 * NULL on failure, with the reason in err. journal_close frees it. */
struct journal *journal_open(const char *path, _Atomic uint64_t *lost, struct sh_err *err);

/* Adds a line; never waits. SH_EINPUT: t_ns is negative, or line is empty, too long or not printable ASCII; nothing is
 * written. SH_ELOST: the file is too slow, and the line is dropped. SH_EIO: the file can't be written; all later calls
 * return that, too, and journal_close gives the reason. */
int journal_write(struct journal *journal, uint64_t tick, int64_t t_ns, uint32_t session, const char *line);

/* Adds a pose of a live platform, of the device time t_ns; failures as in journal_write. v: as pose_line_write takes
 * it. */
int journal_write_pose(struct journal *journal, uint64_t tick, int64_t t_ns, const double v[6]);

/* Sets the tick at which the run ended. journal_close writes the line END with this tick. SH_EINPUT: t_ns is
 * negative. */
int journal_end(struct journal *journal, uint64_t tick, int64_t t_ns);

/* Writes a note, which replaying passes over: one printable line. Failures as in journal_write. */
int journal_note(struct journal *journal, const char *text);

/* 1: a caller that can wait should, so that nothing is dropped. 0 for NULL. */
int journal_is_filling(const struct journal *journal);

/* Writes what is left, as long as the file takes some of it every 2 s; closes and frees. Returns the first error in
 * writing, with its text, or 0. A journal of NULL is allowed. */
int journal_close(struct journal *journal, struct sh_err *err);

struct journal_entry {
    uint64_t tick;
    int64_t t_ns;
    uint32_t session, line_no; /* line of the file, from 1 */
    char line[COMMAND_MAX_LINE + 1];
};

/* 1: no command, but the end of the run. */
int journal_is_end(const struct journal_entry *entry);
/* Returns the numbers of a pose, as pose_line_read takes them; NULL where the entry is none. */
const char *journal_pose(const struct journal_entry *entry);

/* Fails when a journal to write is the one to replay, by whatever path or link: opening it would empty it.
 * Either may be NULL. */
int journal_check_paths(const char *path, const char *replay, struct sh_err *err);

/* Reads a whole file, sorted by tick; commands of one tick stay in the file's order. Errors name file:line. A line
 * after END is an error. So is a last line without a newline, since its command may be cut. Lines have up to 1,023
 * bytes, a journal up to 10,000,000 commands. On failure *entries is NULL. The caller frees it. */
int journal_read(const char *path, struct journal_entry **entries, size_t *n, struct sh_err *err);

#endif

/* SPDX-License-Identifier: MIT */
#include "tests/wire/unit_faults.h"

/* ---- lists of units */

void units_add(struct unit_list *list, const void *bytes, size_t len)
{
    while (list->room < list->len + len) {
        list->room = list->room == 0 ? 1 << 16 : 2 * list->room;
        list->bytes = realloc(list->bytes, list->room);
        assert_non_null(list->bytes);
    }
    memcpy(list->bytes + list->len, bytes, len);
    list->len += len;
}

static void end_at(struct unit_list *list, size_t end)
{
    if ((list->n & (list->n + 1)) == 0) list->end = realloc(list->end, 2 * (list->n + 1) * sizeof *list->end);
    assert_non_null(list->end);
    list->end[list->n++] = end;
}

void units_end(struct unit_list *list)
{
    end_at(list, list->len);
}

void units_cut(struct unit_list *list, size_t (*whole)(const uint8_t *bytes, size_t len))
{
    size_t at = list->n != 0 ? list->end[list->n - 1] : 0;
    for (size_t n; at < list->len && (n = whole(list->bytes + at, list->len - at)) != 0; at += n)
        end_at(list, at + n);
}

const uint8_t *units_get(const struct unit_list *list, uint32_t i, size_t *len)
{
    const size_t from = i != 0 ? list->end[i - 1] : 0;
    assert_true(i < list->n);
    *len = list->end[i] - from;
    return list->bytes + from;
}

void units_free(struct unit_list *list)
{
    free(list->bytes);
    free(list->end);
    *list = (struct unit_list){0};
}

static void read_some(int fd, struct unit_list *list)
{
    static uint8_t bytes[1 << 16];
    const ssize_t n = read(fd, bytes, sizeof bytes);
    assert_true(n > 0);
    units_add(list, bytes, (size_t)n);
}

void units_read_both(int fd0, struct unit_list *list0, int fd1, struct unit_list *list1, size_t least)
{
    while (list0->len < least || (list1 != NULL && list1->len < least)) {
        struct pollfd slot[2] = {{.fd = fd0, .events = POLLIN}, {.fd = fd1, .events = POLLIN}};
        assert_true(poll(slot, 2, DEADLINE_MS) > 0);
        if (slot[0].revents != 0) read_some(fd0, list0);
        if (slot[1].revents != 0) read_some(fd1, list1);
    }
}

/* ---- the truth */

/* Returns the text after "key": in a line; NULL: it has none. */
static const char *member(const char *line, const char *key)
{
    char quoted[32];
    snprintf(quoted, sizeof quoted, "\"%s\":", key);
    const char *at = strstr(line, quoted);
    if (at == NULL) return NULL;
    at += strlen(quoted);
    return at + strspn(at, " ");
}

static int64_t number(const char *line, const char *key, int64_t none)
{
    const char *at = member(line, key);
    return at != NULL ? strtoll(at, NULL, 10) : none;
}

static void text(const char *line, const char *key, char *dst, size_t cap)
{
    const char *at = member(line, key);
    size_t n = 0;
    if (at != NULL && *at == '"') n = strcspn(++at, "\"");
    assert_true(n < cap);
    memcpy(dst, at != NULL ? at : "", n);
    dst[n] = '\0';
}

struct truth_note *truth_read(const char *path, int link, uint32_t *n)
{
    char *all = wire_read(path, NULL), *rest = all;
    struct truth_note *note = NULL;
    *n = 0;
    for (char *line; (line = strsep(&rest, "\n")) != NULL && rest != NULL;) {
        if (number(line, "link", 0) != link) continue;
        note = realloc(note, (*n + 1) * sizeof *note);
        assert_non_null(note);
        struct truth_note *one = &note[(*n)++];
        text(line, "kind", one->kind, sizeof one->kind);
        text(line, "of", one->of, sizeof one->of);
        text(line, "text", one->text, sizeof one->text);
        one->number = (uint64_t)number(line, "frame", number(line, "reply", 0));
        one->n = (uint64_t)number(line, "n", 0);
        one->byte = number(line, "byte", -1);
    }
    free(all);
    return note;
}

uint32_t truth_count(const struct truth_note *note, uint32_t n, const char *kind)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < n; i++)
        count += strcmp(note[i].kind, kind) == 0;
    return count;
}

/* ---- the expected units */

enum how { EXACT, RANDOM, FLIPPED, SEALED };

/* A unit, or the rest of it, in the order in which it must come. */
struct piece {
    enum how how;
    uint8_t *bytes;
    size_t len, whole_len;
    uint64_t n_bits;
    int64_t byte;
    uint64_t split;
    uint64_t after; /* 0, or the unit behind which it comes */
    int is_joined;  /* in the write of the piece before it */
};

struct pieces {
    struct piece *piece;
    uint32_t n;
    uint64_t merge_until; /* up to this unit, what comes is in one write; 0: no merge */
};

static void append(struct pieces *pieces, const struct piece *piece)
{
    pieces->piece = realloc(pieces->piece, (pieces->n + 1) * sizeof *pieces->piece);
    assert_non_null(pieces->piece);
    struct piece *copy = &pieces->piece[pieces->n++];
    *copy = *piece;
    copy->is_joined = pieces->merge_until != 0;
    copy->bytes = malloc(piece->len + 1);
    assert_non_null(copy->bytes);
    memcpy(copy->bytes, piece->bytes, piece->len);
}

static void pieces_free(struct pieces *pieces)
{
    for (uint32_t i = 0; i < pieces->n; i++)
        free(pieces->piece[i].bytes);
    free(pieces->piece);
}

/* Applies one fault to the unit. Returns 0 when the unit does not come at all. *merge: units in a write that begins
 * with it. */
static int apply(const struct truth_note *note, struct piece *unit, uint32_t *copies, uint64_t *merge,
                 struct pieces *out)
{
    static uint8_t random[1024];
    const char *k = note->kind;
    if (strcmp(k, "drop") == 0 || strncmp(note->text, "not sent", 8) == 0) return 0;
    if (strcmp(k, "duplicate") == 0) *copies += (uint32_t)note->n;
    if (strcmp(k, "reorder") == 0) unit->after = note->number + note->n;
    if (strcmp(k, "split") == 0) unit->split = note->n;
    if (strcmp(k, "merge") == 0) *merge = note->n;
    if (strcmp(k, "truncate") == 0) {
        assert_true(note->n > 0 && note->n < unit->len && (size_t)note->byte == unit->len - note->n);
        unit->len = (size_t)note->byte;
    }
    if (strcmp(k, "flip") == 0) {
        assert_true(unit->how == EXACT && note->n > 0 && note->byte >= 0 && (size_t)note->byte < unit->len);
        unit->how = strcmp(note->text, "resealed") == 0 ? SEALED : FLIPPED;
        unit->n_bits = note->n;
        unit->byte = note->byte;
    }
    if (strcmp(k, "garbage") == 0) {
        assert_true(note->n <= sizeof random);
        append(out, &(struct piece){.how = RANDOM, .bytes = random, .len = note->n});
    }
    return 1;
}

/* Units that waited for this one come now. */
static void let_go(const struct pieces *held, uint64_t number, struct pieces *out)
{
    for (uint32_t i = 0; i < held->n; i++)
        if (held->piece[i].after == number) append(out, &held->piece[i]);
}

/* Predicts the session's units from the clean one `first` on. */
static struct pieces predict(const struct unit_kind *kind, const struct unit_list *clean, uint32_t first,
                             const struct truth_note *note, uint32_t n_notes)
{
    struct pieces out = {0}, held = {0};
    for (uint32_t i = first; i < clean->n; i++) {
        size_t len;
        const uint8_t *bytes = units_get(clean, i, &len);
        struct piece unit = {.bytes = malloc(len), .len = len};
        const uint64_t number = i - first + 1;
        uint64_t merge = 0;
        uint32_t copies = 1;
        int comes = 1;
        assert_non_null(unit.bytes);
        memcpy(unit.bytes, bytes, len);
        if (kind->adapt != NULL) kind->adapt(unit.bytes, len, number);
        for (uint32_t k = 0; k < n_notes; k++)
            if (note[k].number == number && strcmp(note[k].of, "stream") == 0)
                comes &= apply(&note[k], &unit, &copies, &merge, &out);
        for (; comes && copies > 0; copies--)
            append(unit.after != 0 ? &held : &out, &unit);
        let_go(&held, number, &out);
        if (merge != 0) out.merge_until = number + merge - 1;
        if (number >= out.merge_until) out.merge_until = 0;
        free(unit.bytes);
    }
    pieces_free(&held);
    return out;
}

/* ---- comparison with the received bytes */

static uint32_t n_bits_changed(const uint8_t *a, const uint8_t *b, size_t len)
{
    uint32_t n = 0;
    for (size_t i = 0; i < len; i++)
        n += (uint32_t)__builtin_popcount(a[i] ^ b[i]);
    return n;
}

/* A checksum is at most two characters, so a right one changes up to 16 bits more. */
static void check_flips(const struct unit_kind *kind, const struct piece *p, const uint8_t *got)
{
    const uint32_t n = n_bits_changed(p->bytes, got, p->len);
    assert_true(p->bytes[p->byte] != got[p->byte]);
    if (p->how == FLIPPED || kind->is_sound == NULL) {
        assert_int_equal(n, p->n_bits);
        return;
    }
    assert_true(n >= p->n_bits && n <= p->n_bits + 16);
    assert_true(kind->is_sound(got, p->len));
}

/* Checks that the piece is there, as far as its bytes are known. */
static void check_piece(const struct unit_kind *kind, const struct piece *p, uint32_t i, const uint8_t *got, size_t len)
{
    if (p->how == RANDOM) return;
    if (p->how == EXACT && memcmp(p->bytes, got, len) != 0) {
        size_t at = 0;
        while (p->bytes[at] == got[at])
            at++;
        fail_msg("piece %u of %zu bytes is another one from byte %zu on", i, p->len, at);
    }
    if (p->how != EXACT && len == p->len) check_flips(kind, p, got);
}

static void check_stream(const struct unit_kind *kind, const struct pieces *want, const struct unit_list *got)
{
    size_t at = 0;
    uint32_t i = 0;
    for (; i < want->n && at < got->len; i++) {
        const struct piece *p = &want->piece[i];
        const size_t left = got->len - at;
        check_piece(kind, p, i, got->bytes + at, p->len < left ? p->len : left);
        at += p->len < left ? p->len : left;
    }
    if (at < got->len) fail_msg("%zu bytes came, and the clean session's end is at %zu", got->len, at);
}

/* Each datagram is a unit. A unit may be split into some, or merged with the units after it. */
static void check_datagrams(const struct unit_kind *kind, const struct pieces *want, const struct unit_list *got)
{
    uint32_t g = 0;
    size_t at = 0; /* in datagram g */
    for (uint32_t i = 0; i < want->n; i++) {
        const struct piece *p = &want->piece[i];
        const uint64_t n = p->split > 1 ? p->split : 1;
        for (uint64_t part = 0; part < n; part++) {
            const size_t from = p->len * part / n, to = p->len * (part + 1) / n;
            size_t len;
            if (g == got->n) fail_msg("datagram %u did not come", g);
            const uint8_t *bytes = units_get(got, g, &len);
            if (at + to - from > len) fail_msg("datagram %u has %zu bytes", g, len);
            if (n > 1)
                assert_memory_equal(bytes + at, p->bytes + from, to - from);
            else
                check_piece(kind, p, i, bytes + at, p->len);
            at += to - from;
            if (part + 1 == n && i + 1 < want->n && want->piece[i + 1].is_joined) continue;
            if (at != len) fail_msg("datagram %u has %zu bytes instead of %zu", g, len, at);
            g++;
            at = 0;
        }
    }
    assert_int_equal(g, got->n);
}

/* Finds the clean unit that was the faulty session's first. */
static uint32_t find_first(const struct unit_kind *kind, const struct unit_list *clean, const struct unit_list *got)
{
    static uint8_t unit[1 << 16];
    for (uint32_t i = 0; i < clean->n; i++) {
        size_t len;
        const uint8_t *bytes = units_get(clean, i, &len);
        assert_true(len <= sizeof unit);
        memcpy(unit, bytes, len);
        if (kind->adapt != NULL) kind->adapt(unit, len, 1);
        if (len <= got->len && memcmp(unit, got->bytes, len) == 0) return i;
    }
    fail_msg("the first unit is none of the %u clean ones", clean->n);
    return 0;
}

uint32_t units_check(const struct unit_kind *kind, const struct unit_list *clean, const struct unit_list *got,
                     const struct truth_note *note, uint32_t n_notes, uint32_t least)
{
    const uint32_t first = find_first(kind, clean, got);
    struct pieces want = predict(kind, clean, first, note, n_notes);
    size_t len = 0;
    uint32_t n = 0;
    if (kind->datagrams)
        check_datagrams(kind, &want, got);
    else
        check_stream(kind, &want, got);
    while (n < want.n && (len += want.piece[n].len) <= got->len)
        n++;
    if (n < least) fail_msg("%u of %u pieces came; %u are few", n, want.n, least);
    pieces_free(&want);
    return n;
}

void units_expect(const struct unit_list *clean, const struct truth_note *note, uint32_t n_notes, struct unit_list *out)
{
    static const struct unit_kind as_it_is = {0};
    struct pieces want = predict(&as_it_is, clean, 0, note, n_notes);
    for (uint32_t i = 0; i < want.n; i++) {
        const struct piece *p = &want.piece[i];
        assert_true(p->how == EXACT && p->split < 2 && !p->is_joined);
        units_add(out, p->bytes, p->len);
        units_end(out);
    }
    pieces_free(&want);
}

/* SPDX-License-Identifier: MIT */
#include "tests/unit/wire_rig.h"

#include "drivers/protocol/protocol.h"

struct rig rig;

struct fault fault_of_kind(enum fault_kind kind)
{
    return (struct fault){
        .kind = kind, .from = 1, .every = 1, .probability = 1.0, .until_pulse = UINT64_MAX, .seed = 1, .byte = -1};
}

static void keep_note(void *ctx, const struct fault_note *note)
{
    (void)ctx;
    assert_true(rig.n_notes < RIG_NOTES);
    rig.note[rig.n_notes++] = *note;
}

static void reseal_sum(uint8_t *unit, size_t len)
{
    uint8_t sum = 0;
    for (size_t i = 0; i + 1 < len; i++)
        sum = (uint8_t)(sum + unit[i]);
    unit[len - 1] = sum;
}

void rig_open(const struct fault *fault, uint32_t n, int native)
{
    static uint8_t *out; /* made once: static arrays of this size would be searched for leaks in every program */
    static struct rig_write *write;
    struct sh_err err;
    if (out == NULL) out = malloc(RIG_OUT);
    if (write == NULL) write = malloc(RIG_WRITES * sizeof *write);
    assert_true(out != NULL && write != NULL);
    memset(&rig, 0, sizeof rig);
    rig.out = out;
    rig.write = write;
    rig.list.n = n;
    rig.native = native;
    rig.now_ns = 1000 * MS;
    rig.seq = UINT32_MAX - 5; /* its numbers soon wrap */
    if (n != 0) memcpy(rig.list.fault, fault, n * sizeof *fault);
    assert_int_equal(fault_board_create(&rig.list, NULL, NULL, &rig.board, &err), SH_OK);
    fault_board_listen(rig.board, keep_note, NULL);
    const struct wire_spec spec = {.board = rig.board,
                                   .link = 1,
                                   .session = 1,
                                   .max_unit = 64,
                                   .units = !native,
                                   .native = native,
                                   .content = native ? protocol_ops_get(PROTOCOL_NATIVE)->content : NULL,
                                   .reseal = native ? native_reseal : reseal_sum,
                                   .acts = UINT32_MAX,
                                   .heard = &rig.heard};
    rig.heard.has_lines = native;
    rig.wire = wire_create(&spec);
    assert_non_null(rig.wire);
}

void rig_close(void)
{
    wire_free(rig.wire);
    wire_heard_free(&rig.heard);
    fault_board_free(rig.board);
    rig.wire = NULL;
    rig.board = NULL;
}

static struct rig_item *next_item(int of, size_t len)
{
    assert_true(rig.n_items < RIG_ITEMS && len <= RIG_UNIT);
    struct rig_item *item = &rig.item[rig.n_items++];
    item->of = of;
    item->number = ++rig.count[of];
    item->len = len;
    item->notes_from = rig.n_notes;
    for (size_t i = 0; i < len; i++)
        item->bytes[i] = (uint8_t)(crc32c(rig.n_items, (const uint8_t *)&i, sizeof i) >> 7);
    return item;
}

static struct rig_item *put(struct rig_item *item, int64_t t_ns)
{
    const struct wire_item given = {.of = item->of, .bytes = item->bytes, .len = item->len, .t_ns = t_ns};
    assert_int_equal(wire_put(rig.wire, &given, rig.now_ns), SH_OK);
    rig.now_ns += 1000;
    return item;
}

struct rig_item *rig_frame_at(enum rig_frame kind, size_t payload_len, int64_t t_ns, uint64_t pulse0)
{
    struct rig_item *item = next_item(kind == RIG_NOTICE || kind == RIG_LOCAL ? FAULT_OF_NOTICES : FAULT_OF_STREAM,
                                      NATIVE_HEADER_LEN + payload_len);
    uint8_t *f = item->bytes, *payload = f + NATIVE_HEADER_LEN;
    f[0] = NATIVE_SYNC;
    f[1] = kind == RIG_POINTS ? NATIVE_POINTS : kind == RIG_STREAM ? NATIVE_LINE_END : NATIVE_TELEMETRY;
    f[2] = NATIVE_VERSION;
    f[3] = kind == RIG_LOCAL ? NATIVE_LOCAL : 0;
    le_put32(f + 4, (uint32_t)payload_len);
    le_put32(f + 8, kind == RIG_LOCAL ? 0 : (uint32_t)rig.seq++);
    le_put64(f + 16, (uint64_t)t_ns);
    if (kind == RIG_POINTS) {
        assert_true(payload_len >= NATIVE_POINTS_HEAD_LEN);
        le_put64(payload + 8, pulse0);
        le_put32(payload + 32, 100); /* pulses */
        le_put32(payload + 36, 0);   /* points */
    }
    native_reseal(f, item->len);
    return put(item, t_ns);
}

struct rig_item *rig_frame(enum rig_frame kind)
{
    return rig_frame_at(kind, 40 + rig.n_items % 61, (int64_t)rig.n_items * MS, 100 * rig.count[FAULT_OF_STREAM]);
}

struct rig_item *rig_reply(const char *line)
{
    struct rig_item *item = next_item(FAULT_OF_REPLIES, strlen(line) + 2);
    memcpy(item->bytes, line, strlen(line));
    memcpy(item->bytes + strlen(line), "\r\n", 2);
    return put(item, 0);
}

struct rig_item *rig_unit(size_t len, int is_reply)
{
    struct rig_item *item = next_item(is_reply ? FAULT_OF_REPLIES : FAULT_OF_STREAM, len);
    reseal_sum(item->bytes, len);
    return put(item, (int64_t)rig.n_items * MS);
}

uint32_t rig_take(int last)
{
    uint32_t n = 0;
    if (last) wire_time(rig.wire, INT64_MAX);
    for (struct wire_piece *piece; (piece = wire_due(rig.wire, rig.now_ns)) != NULL; n++) {
        const size_t len = piece->kind != WIRE_ACT ? piece->len - piece->out : 0;
        if (piece->kind == WIRE_ACT) fault_board_note(rig.board, wire_act_note(piece)); /* it is carried out */
        assert_true(rig.n_writes < RIG_WRITES && rig.n_out + len <= RIG_OUT);
        rig.write[rig.n_writes++] =
            (struct rig_write){rig.now_ns, piece->kind, piece->act, rig.n_out, len, piece->n, piece->for_ms};
        if (len != 0) memcpy(rig.out + rig.n_out, piece->bytes + piece->out, len);
        rig.n_out += len;
        wire_pop(rig.wire);
    }
    return n;
}

void rig_drain(void)
{
    for (int i = 0; i < 100000; i++) {
        rig_take(1);
        if (wire_is_empty(rig.wire)) return;
        const int64_t next_ns = wire_next_ns(rig.wire);
        assert_true(next_ns > rig.now_ns && next_ns != INT64_MAX); /* else the wire would never be woken */
        rig.now_ns = next_ns;
    }
    fail_msg("it does not end");
}

void rig_expect(const int *items)
{
    size_t at = 0;
    for (; *items >= 0; items++) {
        const struct rig_item *item = &rig.item[*items];
        if (at + item->len > rig.n_out || memcmp(rig.out + at, item->bytes, item->len) != 0)
            fail_msg("item %d does not come at byte %zu of %zu", *items, at, rig.n_out);
        at += item->len;
    }
    assert_int_equal(at, rig.n_out);
}

/* ---- the expected output, by the notes. Each item has its place in the input; a held item has the place of the frame
 * that it comes after. The items sorted by place are the output. */

struct chunk {
    uint64_t place; /* of an item, from 0; frames that did not come have places after all items */
    uint32_t rank;  /* its order at that place: pieces before the item, the item, pieces that were held until it */
    uint32_t order;
    int is_garbage;
    size_t len;
    uint8_t bytes[RIG_UNIT];
};

static struct chunk *chunk;
static uint32_t n_chunks;

static int compare(const void *a, const void *b)
{
    const struct chunk *x = a, *y = b;
    if (x->place != y->place) return x->place < y->place ? -1 : 1;
    if (x->rank != y->rank) return x->rank < y->rank ? -1 : 1;
    return x->order < y->order ? -1 : x->order > y->order;
}

/* Returns the place of item `number` among those that are counted as `of`. */
static uint64_t place_of(int of, uint64_t number)
{
    for (uint32_t i = 0; i < rig.n_items; i++)
        if (rig.item[i].of == of && rig.item[i].number == number) return i;
    return ((uint64_t)1 << 40) + ((uint64_t)of << 32) + number;
}

static struct chunk *add_chunk(uint64_t place, uint32_t rank)
{
    chunk = realloc(chunk, (n_chunks + 1) * sizeof *chunk);
    assert_non_null(chunk);
    chunk[n_chunks] = (struct chunk){.place = place, .rank = rank, .order = n_chunks};
    return &chunk[n_chunks++];
}

static void flip(struct chunk *c, const uint8_t *before, const struct fault_note *note, size_t from, int one_byte)
{
    const uint64_t begin = 8 * (one_byte ? (uint64_t)note->byte : from), n_bits = one_byte ? 8 : 8 * (c->len - from);
    uint64_t at = 8 * (uint64_t)note->byte + note->bit, left = note->n;
    for (uint64_t i = 0; i < n_bits && left > 0; i++, at = begin + (at + 1 - begin) % n_bits) {
        const uint8_t bit = (uint8_t)(1 << at % 8);
        if (((c->bytes[at / 8] ^ before[at / 8]) & bit) != 0) continue;
        c->bytes[at / 8] ^= bit;
        left--;
    }
    assert_int_equal(left, 0);
}

static uint64_t copies, behind;
static int dropped, damaged;

static void apply(struct chunk *c, const struct rig_item *item, const struct fault_note *note)
{
    const int resealed = strcmp(note->text, "resealed") == 0, native = rig.native;
    switch (note->kind) {
    case FAULT_DROP:
        dropped = 1;
        break;
    case FAULT_DUPLICATE:
        copies += note->n;
        break;
    case FAULT_REORDER:
        behind = note->n;
        break;
    case FAULT_TRUNCATE:
        assert_int_equal((uint64_t)note->byte + note->n, c->len);
        c->len = (size_t)note->byte;
        damaged = 1;
        break;
    case FAULT_FLIP:
        flip(c, item->bytes, note, resealed && native ? NATIVE_HEADER_LEN : 0,
             rig.list.fault[note->fault - 1].byte >= 0);
        if (resealed && native) native_reseal(c->bytes, c->len);
        if (resealed && !native) reseal_sum(c->bytes, c->len);
        damaged |= !resealed;
        break;
    default: /* changes no byte */
        break;
    }
}

/* Adds an item. Returns how many whole and right ones it gives. */
static uint32_t add_item(uint32_t i)
{
    const struct rig_item *item = &rig.item[i];
    const uint32_t to = i + 1 < rig.n_items ? rig.item[i + 1].notes_from : rig.n_notes;
    struct chunk changed = {.len = item->len};
    memcpy(changed.bytes, item->bytes, item->len);
    copies = 1;
    behind = 0;
    dropped = damaged = 0;
    for (uint32_t k = item->notes_from; k < to; k++) {
        const struct fault_note *note = &rig.note[k];
        assert_true(note->of == item->of && note->number == item->number && note->link == 1 && note->session == 1);
        if (note->has_seq) assert_int_equal(note->seq, le_get32(item->bytes + 8));
        if (note->kind == FAULT_GARBAGE) {
            struct chunk *c = add_chunk(i, 0);
            c->is_garbage = 1;
            c->len = note->n;
        }
        apply(&changed, item, note);
    }
    for (uint64_t k = 0; k < copies && !dropped; k++) {
        struct chunk *c = behind != 0 ? add_chunk(place_of(item->of, item->number + behind), 2) : add_chunk(i, 1);
        c->len = changed.len;
        memcpy(c->bytes, changed.bytes, changed.len);
    }
    return dropped || damaged ? 0 : (uint32_t)copies;
}

uint32_t rig_check_notes(void)
{
    uint32_t whole = 0;
    size_t at = 0;
    n_chunks = 0;
    for (uint32_t i = 0; i < rig.n_items; i++)
        whole += add_item(i);
    qsort(chunk, n_chunks, sizeof *chunk, compare);
    for (uint32_t i = 0; i < n_chunks; i++) {
        const struct chunk *c = &chunk[i];
        if (at + c->len > rig.n_out || (!c->is_garbage && memcmp(rig.out + at, c->bytes, c->len) != 0))
            fail_msg("byte %zu of %zu: not what the notes say of item %u", at, rig.n_out, (unsigned)c->place);
        at += c->len;
    }
    assert_int_equal(at, rig.n_out);
    free(chunk);
    chunk = NULL;
    return whole;
}

int rig_teardown(void **state)
{
    (void)state;
    rig_close();
    return 0;
}

void rig_run(const struct fault *fault, uint32_t n_frames)
{
    rig_open(fault, 1, 1);
    for (uint32_t i = 0; i < n_frames; i++)
        rig_frame(RIG_STREAM);
}

void rig_end(uint32_t whole)
{
    rig_drain();
    assert_int_equal(rig_check_notes(), whole);
    rig_close();
}

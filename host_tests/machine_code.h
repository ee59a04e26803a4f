/* What kernels in C need (machine_code.py): memory that they reach by pointers, and the operators of
   Python. A kernel that fails leaves by longjmp with Python's exception set. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <setjmp.h>
#include <stdint.h>

typedef int64_t word;

/* Memory behind a pointer, or a device: an object with __getitem__ and __setitem__. */
typedef struct {
    PyObject *object;
    char *start; /* NULL: a device */
    word count, writable;
} pointer;

static PyObject *memory; /* native_cpython's: address -> object */
static jmp_buf *caller;

static _Noreturn void leave(void) { longjmp(*caller, 1); }

static _Noreturn void fail(PyObject *kind, const char *text) {
    PyErr_SetString(kind, text);
    leave();
}

/* Each turn of a loop comes here, so that a signal can end a loop that does not end. */
static inline void turn(void) {
    static uint32_t turns;
    if ((++turns & 0xFFFFF) == 0 && PyErr_CheckSignals())
        leave();
}

static PyObject *at_address(word address) {
    PyObject *key = PyLong_FromLongLong(address);
    PyObject *found = PyDict_GetItemWithError(memory, key);
    Py_DECREF(key);
    if (!found)
        fail(PyExc_KeyError, "no memory has this address");
    return found;
}

static int is_device(PyObject *object) {
    PyMappingMethods *has = Py_TYPE(object)->tp_as_mapping;
    return has && (has->mp_subscript || has->mp_ass_subscript);
}

static pointer to_object(PyObject *object, int size) {
    if (PyLong_Check(object))
        object = at_address(PyLong_AsLongLong(object));
    pointer p = {object, NULL, 0, 0};
    if (!PyObject_CheckBuffer(object)) {
        if (!is_device(object))
            fail(PyExc_TypeError, "a kernel's pointer leads to no memory");
        return p;
    }
    Py_buffer view;
    if (PyObject_GetBuffer(object, &view, PyBUF_CONTIG_RO | PyBUF_FORMAT))
        leave();
    int fits = size == 1 || (view.itemsize == size && *view.format == (size == 4 ? 'i' : 'H'));
    p.start = view.buf;
    p.count = view.len / size;
    p.writable = view.readonly ? 0 : p.count;
    PyBuffer_Release(&view); /* it stays: no memory of a kernel grows or is freed meanwhile */
    if (!fits)
        fail(PyExc_TypeError, "a kernel's pointer leads to items of another size");
    return p;
}

static inline pointer to_address(word address, int size) {
    return to_object(at_address(address), size);
}

static word device_load(pointer p, word i) {
    PyObject *key = PyLong_FromLongLong(i), *value = PyObject_GetItem(p.object, key);
    Py_DECREF(key);
    if (!value)
        leave();
    word found = PyLong_AsLongLong(value);
    Py_DECREF(value);
    if (found == -1 && PyErr_Occurred())
        leave();
    return found;
}

static void device_store(pointer p, word i, word value) {
    PyObject *key = PyLong_FromLongLong(i), *item = PyLong_FromLongLong(value);
    int failed = PyObject_SetItem(p.object, key, item);
    Py_DECREF(key);
    Py_DECREF(item);
    if (failed)
        leave();
}

#define MEMORY(type, name, least, most)                                             \
    static inline word load_##name(pointer p, word i) {                             \
        if ((uint64_t)i < (uint64_t)p.count)                                        \
            return ((type *)p.start)[i];                                            \
        if (!p.start)                                                               \
            return device_load(p, i);                                               \
        fail(PyExc_IndexError, "a kernel reads outside of its memory");             \
    }                                                                               \
    static inline void store_##name(pointer p, word i, word value) {                \
        if ((uint64_t)i < (uint64_t)p.writable) {                                   \
            if (value < least || value > most)                                      \
                fail(PyExc_OverflowError, "a kernel stores more than an item holds"); \
            ((type *)p.start)[i] = (type)value;                                     \
        } else if (!p.start)                                                        \
            device_store(p, i, value);                                              \
        else                                                                        \
            fail(PyExc_IndexError, "a kernel writes outside of its memory");        \
    }

MEMORY(uint8_t, 1, 0, UINT8_MAX)
MEMORY(uint16_t, 2, 0, UINT16_MAX)
MEMORY(int32_t, 4, INT32_MIN, INT32_MAX)

/* An item of a list or a tuple of a kernel's memories. */
static PyObject *item(PyObject *list, word i) {
    if (PyList_Check(list) && (uint64_t)i < (uint64_t)PyList_GET_SIZE(list))
        return PyList_GET_ITEM(list, i);
    if (PyTuple_Check(list) && (uint64_t)i < (uint64_t)PyTuple_GET_SIZE(list))
        return PyTuple_GET_ITEM(list, i);
    fail(PyExc_IndexError, "a kernel looks for an object that is not in the list");
}

/* What an object has for its own, so that it lives as long as the object. */
static PyObject *attribute(PyObject *object, const char *name) {
    PyObject *found = PyObject_GetAttrString(object, name);
    if (!found)
        leave();
    if (Py_REFCNT(found) == 1 && !PyLong_Check(found))
        fail(PyExc_TypeError, "a kernel reads an attribute that nothing keeps");
    Py_DECREF(found);
    return found;
}

static word number(PyObject *object) {
    word found = PyLong_AsLongLong(object);
    if (found == -1 && PyErr_Occurred())
        leave();
    return found;
}

static int truth(PyObject *object) {
    int found = PyObject_IsTrue(object);
    if (found < 0)
        leave();
    return found;
}

static word length(PyObject *object) {
    Py_ssize_t found = PyObject_Length(object);
    if (found < 0)
        leave();
    return found;
}

static void set_attribute(PyObject *object, const char *name, PyObject *value) {
    int failed = PyObject_SetAttrString(object, name, value);
    Py_DECREF(value);
    if (failed)
        leave();
}

/* The number that a function in Python, or an object's method, returns; 0 for None. form: of
   Py_BuildValue. */
static word called(PyObject *object, const char *method, const char *form, ...) {
    va_list given;
    va_start(given, form);
    PyObject *arguments = Py_VaBuildValue(form, given);
    va_end(given);
    PyObject *function = method ? PyObject_GetAttrString(object, method) : Py_NewRef(object);
    PyObject *found = arguments && function ? PyObject_CallObject(function, arguments) : NULL;
    Py_XDECREF(function);
    Py_XDECREF(arguments);
    if (!found)
        leave();
    word result = found == Py_None ? 0 : PyLong_AsLongLong(found);
    Py_DECREF(found);
    if (result == -1 && PyErr_Occurred())
        leave();
    return result;
}

/* The result of an operation has to fit a board's word. */
static _Noreturn void leaves_word(word value, int line) {
    PyErr_Format(PyExc_OverflowError, "%lld leaves 32 bits in a kernel, line %d", (long long)value, line);
    leave();
}

static inline word fit(word value, int line) {
    if (value != (int32_t)value)
        leaves_word(value, line);
    return value;
}

static inline word wrapped(word value) { return (int32_t)value; }

static inline word left_shift(word a, word n) {
    if (n < 0)
        fail(PyExc_ValueError, "negative shift count");
    if (n > 63)
        fail(PyExc_OverflowError, "a kernel shifts out of a word");
    return (word)((uint64_t)a << n);
}

static inline word right_shift(word a, word n) {
    if (n < 0)
        fail(PyExc_ValueError, "negative shift count");
    return a >> (n > 63 ? 63 : n);
}

static inline word divided(word a, word b) {
    if (b == 0)
        fail(PyExc_ZeroDivisionError, "integer division or modulo by zero");
    return a / b - (a % b != 0 && (a ^ b) < 0);
}

static inline word modulo(word a, word b) { return a - divided(a, b) * b; }

/* A kernel's arguments: for others than small numbers and memory the function in Python is called. */
static inline int is_word(PyObject *object) {
    int beyond = 0;
    if (!PyLong_Check(object))
        return 0;
    PyLong_AsLongLongAndOverflow(object, &beyond);
    return !beyond;
}

static inline int is_memory(PyObject *object) {
    return PyObject_CheckBuffer(object) || is_device(object);
}

static PyObject *method(PyObject *self, PyObject *function) { return PyInstanceMethod_New(function); }

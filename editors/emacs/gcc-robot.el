;;; gcc-robot.el --- G-code and STEP-NC with the language server gcc-robot -*- lexical-binding: t -*-

;; Version: 0.1.0
;; Package-Requires: ((emacs "28.1") (eglot "1.9"))
;; SPDX-License-Identifier: MIT OR Apache-2.0

;;; Commentary:

;; Major modes for G-code and STEP-NC files, and what eglot needs to start `gcc-robot lsp' for them.  In your init
;; file:
;;
;;   (add-to-list 'load-path "/path/to/gcc-robot/editors/emacs")
;;   (require 'gcc-robot)
;;   (add-hook 'gcode-mode-hook #'eglot-ensure)
;;   (add-hook 'p21-mode-hook #'eglot-ensure)
;;   (add-hook 'gcc-robot-file-mode-hook #'eglot-ensure)   ; project and machine files, tool tables, INI, parameters

;;; Code:

(require 'eglot)

(defgroup gcc-robot nil
  "G-code and STEP-NC."
  :group 'languages
  :prefix "gcc-robot-")

(defcustom gcc-robot-program "gcc-robot"
  "The program gcc-robot."
  :type 'string)

(defcustom gcc-robot-settings nil
  "Settings of the server, a property list such as (:dialect \"fanuc-mill\" :machine \"generic/mill3\")."
  :type 'plist)

(defvar gcode-mode-syntax-table
  (let ((table (make-syntax-table)))
    (modify-syntax-entry ?\( "<" table)
    (modify-syntax-entry ?\) ">" table)
    (modify-syntax-entry ?\; "< b" table)
    (modify-syntax-entry ?\n "> b" table)
    (modify-syntax-entry ?\[ "(]" table)
    (modify-syntax-entry ?\] ")[" table)
    table)
  "Syntax of G-code.")

(defvar gcode-mode-font-lock-keywords
  '(("[Oo][ \t]*\\(?:<[^>\n]*>\\|[0-9]+\\)" . font-lock-function-name-face)
    ("#+\\(?:<[^>\n]*>\\|[0-9]+\\)" . font-lock-variable-name-face)
    ("\\<\\(?:endsub\\|sub\\|call\\|do\\|while\\|endwhile\\|if\\|elseif\\|else\\|endif\\|break\\|continue\\|return\\|repeat\\|endrepeat\\|goto\\)\\>"
     . font-lock-keyword-face)
    ("[Gg][ \t]*[0-9][0-9 ]*\\(?:\\.[0-9]+\\)?" . font-lock-keyword-face)
    ("[MmTt][ \t]*[0-9]+" . font-lock-builtin-face)
    ("[Nn][ \t]*[0-9]+" . font-lock-constant-face)
    ("[A-Za-z]\\(?:[ \t]*[-+0-9.#[]\\)" 0 font-lock-type-face))
  "Colours of G-code.")

;;;###autoload
(define-derived-mode gcode-mode prog-mode "G-code"
  "Programs of CNC machines."
  (setq-local comment-start "(")
  (setq-local comment-end ")")
  (setq-local comment-start-skip "(\\s-*\\|;+\\s-*")
  (setq-local font-lock-defaults '(gcode-mode-font-lock-keywords nil t)))

(defvar p21-mode-syntax-table
  (let ((table (make-syntax-table)))
    (modify-syntax-entry ?/ ". 14" table)
    (modify-syntax-entry ?* ". 23" table)
    (modify-syntax-entry ?\' "\"" table)
    (modify-syntax-entry ?_ "w" table)
    table)
  "Syntax of Part 21.")

(defvar p21-mode-font-lock-keywords
  '(("^[ \t]*#[0-9]+" . font-lock-constant-face)
    ("#[0-9]+" . font-lock-variable-name-face)
    ("\\.[A-Z0-9_]+\\." . font-lock-constant-face)
    ("\\<\\(?:HEADER\\|DATA\\|ENDSEC\\|END-ISO-10303-21\\|ISO-10303-21\\)\\>" . font-lock-keyword-face)
    ("\\<[A-Z][A-Z0-9_]*\\>" . font-lock-type-face))
  "Colours of Part 21.")

;;;###autoload
(define-derived-mode p21-mode prog-mode "STEP-NC"
  "STEP-NC programs (Part 21 files)."
  (setq-local comment-start "/*")
  (setq-local comment-end "*/")
  (setq-local font-lock-defaults '(p21-mode-font-lock-keywords)))

;;;###autoload
(add-to-list 'auto-mode-alist '("\\.\\(?:ngc\\|nc\\|cnc\\|tap\\|eia\\|gc\\|g\\|gcode\\)\\'" . gcode-mode))
;;;###autoload
(add-to-list 'auto-mode-alist '("\\.\\(?:p21\\|stpnc\\)\\'" . p21-mode))

(defun gcc-robot--is-stepnc ()
  "Whether the buffer begins a Part 21 file with a schema of machining."
  (let ((case-fold-search t))
    (and (looking-at "[ \t\n\r]*ISO-10303-21[ \t]*;")
         (save-excursion
           (re-search-forward
            "FILE_SCHEMA[ \t\n\r]*([ \t\n\r]*([ \t\n\r]*'\\(?:MACHINING_SCHEMA\\|MILLING_SCHEMA\\|TURNING_SCHEMA\\|COMBINED_SCHEMA\\|INTEGRATED_CNC_SCHEMA\\|MODEL_BASED_INTEGRATED_MANUFACTURING\\|AP238\\)"
            (+ (point) 8192) t)))))

;;;###autoload
(add-to-list 'magic-mode-alist '(gcc-robot--is-stepnc . p21-mode))

;;;###autoload
(define-derived-mode gcc-robot-file-mode conf-mode "gcc-robot"
  "Files that programs are run with: project and machine files, tool tables, INI and parameter files."
  (setq-local comment-start (if (string-suffix-p ".tbl" (or buffer-file-name "")) ";" "#")))

;;;###autoload
(add-to-list 'auto-mode-alist '("\\(?:/gcc-robot\\.toml\\|\\.tbl\\|\\.var\\)\\'" . gcc-robot-file-mode))

(defun gcc-robot--is-file-of-machine ()
  "Whether the buffer is a machine file or an INI file of LinuxCNC."
  (let ((name (or buffer-file-name "")))
    (save-excursion
      (cond
       ((string-suffix-p ".toml" name)
        (and (re-search-forward "^[ \t]*format[ \t]*=" nil t)
             (progn (goto-char (point-min))
                    (re-search-forward "^[ \t]*\\(?:\\[kinematics\\]\\|extends\\|\\[\\[joint\\]\\]\\)" nil t))))
       ((string-suffix-p ".ini" name)
        (re-search-forward "^[ \t]*\\[\\(?:RS274NGC\\|EMC\\|EMCIO\\|TRAJ\\|KINS\\)\\]" nil t))))))

;;;###autoload
(add-to-list 'magic-mode-alist '(gcc-robot--is-file-of-machine . gcc-robot-file-mode))

(defun gcc-robot--contact (_interactive)
  "How eglot starts the server."
  (list gcc-robot-program "lsp" :initializationOptions (or gcc-robot-settings eglot--{})))

(add-to-list 'eglot-server-programs '((gcode-mode p21-mode gcc-robot-file-mode) . gcc-robot--contact))

(defun gcc-robot-explain (name)
  "Explain NAME: a diagnostic, a code, a word or an entity of STEP-NC."
  (interactive (list (read-string "Explain: " (thing-at-point 'word t))))
  (with-help-window "*gcc-robot explain*"
    (princ (with-temp-buffer
             (call-process gcc-robot-program nil t nil "explain" name)
             (buffer-string)))))

(provide 'gcc-robot)
;;; gcc-robot.el ends here
